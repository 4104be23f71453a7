"""What light says of its own dependence on the fog, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

import spisim
import worlds
from reconstruction.base.errors import InputError
from spisim.atmosphere import henyey_greenstein
from spisim.scene import Material
from spisim.scene.bsdf import Principled, ThinPane
from spisim.simulation.light.other_fog import OtherFog
from spisim.simulation.light.sensitivity import sensitivities, weights_of
from spisim.simulation.light.solve import solve_fogs
from spisim.transport import Outputs

VISIBILITY_M = 50.0
NAMES = ("scene.fog.visibility_m", "scene.fog.extinction_per_m", "scene.fog.albedo")


def foggy(**changes):
    scene = worlds.scene(worlds.plane(4.0), extinction_per_m=0.08, g=0.8)
    fog = replace(scene.atmosphere, visibility_m=VISIBILITY_M, **changes)
    return replace(scene, atmosphere=fog)


def mixed():
    """Mist and rain in one."""
    parts = foggy(kind="mist").atmosphere, foggy(kind="rain").atmosphere
    return foggy(parts=parts)


@pytest.fixture(scope="module")
def light():
    scene = foggy()
    wanted = sensitivities(scene, NAMES)
    instrument = spisim.load_instrument("paper")
    outputs = Outputs(weights=weights_of(wanted))
    others = [OtherFog.of_visibility(scene, 70.0), OtherFog.of(scene, 12.0)]
    return solve_fogs(scene, instrument, others, spp=16, outputs=outputs), wanted


def test_derivatives_by_visibility_and_extinction_say_the_same(light):
    (transport, *_), (visibility, extinction, albedo) = light
    for name in ("image", "spot_histogram"):
        by_visibility, error = visibility.of(transport, name)
        np.testing.assert_allclose(
            by_visibility * VISIBILITY_M, -0.08 * extinction.of(transport, name)[0]
        )
        assert (error >= 0).all()
        assert (albedo.of(transport, name)[0] >= 0).all()
    assert (visibility.unit, extinction.unit, albedo.unit) == ("1/m", "m", "1")


def test_other_fog_is_carried_by_most_paths_and_goes_on_from_the_derivative(light):
    (transport, other, _), (visibility, *_) = light
    assert 0.8 < other.reweighted.carried <= 1
    assert other.reweighted.require_carried() == other.reweighted.carried
    first_order = transport.image + 20 * visibility.of(transport)[0]
    assert other.image.sum() == pytest.approx(first_order.sum(), rel=0.25)
    assert (other.image_error > 0).any()
    assert (other.spot_histogram_error > 0).any()
    assert not set(other.extra) - {"spot_orders"}


def test_fog_far_away_is_refused_with_the_fraction_that_carries_it(light):
    *_, far = light[0]
    with pytest.raises(InputError, match=r"12 times the extinction is too far .*% of the paths"):
        far.reweighted.require_carried()


@pytest.mark.parametrize(
    ("scene", "name", "message"),
    [
        (foggy(), "scene.fog.visibility", "did you mean 'scene.fog.visibility_m'"),
        (foggy(albedo=0.0), "scene.fog.albedo", "needs light that fog scatters"),
        (worlds.scene(worlds.plane(4.0)), NAMES[0], "the air is clear"),
        (worlds.scene(extinction_per_m=0.1), NAMES[0], "the visibility of this fog is unknown"),
        (mixed(), NAMES[0], "the weather is a mixture of mist and rain; leave one alone"),
        (foggy(phase=henyey_greenstein(0)), "scene.fog.g", "must be that of Henyey and Greenstein"),
        (foggy(), "materials.plain", "did you mean 'materials.plane'"),
    ],
)
def test_what_paths_do_not_tell_is_refused(scene, name, message):
    with pytest.raises(InputError, match=message):
        sensitivities(scene, [name])


@pytest.mark.parametrize(
    ("material", "message"),
    [
        (Material("it", 0.0, "test"), r"materials.it: reflectance = 0, so that no path"),
        (Material("it", 0.04, "test", ThinPane()), "materials.it: glass reflects by refraction"),
        (Material("it", 0.5, "test", Principled(metallic=0.5)), "metallic = 0.5 mixes two"),
    ],
)
def test_materials_without_a_derivative_are_refused(material, message):
    scene = foggy()
    thing = replace(scene.objects[0], material=material)
    with pytest.raises(InputError, match=message):
        sensitivities(replace(scene, objects=(thing,)), ["materials.it"])
