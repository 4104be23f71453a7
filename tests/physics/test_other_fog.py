"""Light in other fogs from the paths of one pass, against passes through them: |z| < 4."""

from dataclasses import replace

import numpy as np
import pytest

import spisim
import worlds
from spisim.simulation.light.fogs import trace_fogs
from spisim.simulation.light.other_fog import OtherFog
from spisim.simulation.light.solve import solve, solve_fogs
from spisim.transport import Outputs

PAPER = spisim.load_instrument("paper")
SEEDS = range(8)
ORDERS = Outputs(orders=True)
TRACED_M = 50.0


def room(visibility_m):
    scene = worlds.scene(*worlds.room(), extinction_per_m=4.0 / visibility_m, g=0.8, albedo=0.98)
    return replace(scene, atmosphere=replace(scene.atmosphere, visibility_m=visibility_m))


def figures(light):
    """Halves of the image, its parts by scattering, the spots' light and its parts near and far."""
    image, spots, orders = light.image, light.spot_histogram, light.extra["spot_orders"]
    near = light.path_length_m < 4.0
    parts = (
        image[:32].sum(),
        image[32:].sum(),
        *light.extra["orders"].sum(axis=(1, 2)),
        *orders[..., near].sum(axis=-1).ravel(),
        *orders[..., ~near].sum(axis=-1).ravel(),
        *(spots * light.path_length_m).sum(axis=-1),
    )
    return np.array(parts)


def test_light_in_other_fogs_is_that_of_passes_through_them():
    scene = room(TRACED_M)
    others = [OtherFog.of_visibility(scene, each) for each in (35.0, 80.0)]
    passes = [solve_fogs(scene, PAPER, others, spp=16, seed=seed, outputs=ORDERS) for seed in SEEDS]
    for number, other in enumerate(others, start=1):
        through = [
            figures(solve(other.scene, PAPER, spp=16, seed=50 + seed, outputs=ORDERS))
            for seed in SEEDS
        ]
        off = np.array([figures(each[number]) for each in passes]) - through
        error = off.std(axis=0, ddof=1) / np.sqrt(len(SEEDS))
        z = np.divide(off.mean(axis=0), error, out=np.zeros(error.shape), where=error > 0)
        assert np.abs(z).max() < 4
        assert passes[0][number].reweighted.carried > 0.5


def test_stated_errors_are_those_of_repetitions():
    scene = room(TRACED_M)
    other = OtherFog.of_visibility(scene, 35.0)
    lights = [solve_fogs(scene, PAPER, [other], spp=16, seed=seed)[1] for seed in SEEDS]
    for name in ("image", "spot_histogram"):
        values = np.array([getattr(each, name) for each in lights])
        stated = np.array([getattr(each, f"{name}_error") for each in lights])
        scatter = np.sqrt((values.var(axis=0, ddof=1)).sum())
        assert np.sqrt((stated**2).mean(axis=0).sum()) == pytest.approx(scatter, rel=0.2)


def test_the_traced_fog_is_that_of_a_pass_alone():
    scene = room(TRACED_M)
    alone = solve(scene, PAPER, spp=4, seed=3)
    own, _ = solve_fogs(scene, PAPER, [OtherFog.of(scene, 0.5)], spp=4, seed=3)
    np.testing.assert_array_equal(own.image, alone.image)
    np.testing.assert_array_equal(own.spot_histogram, alone.spot_histogram)
    assert (own.noise_share, own.spot_noise_share) == (alone.noise_share, alone.spot_noise_share)
    assert own.daylight_w == alone.daylight_w


def test_every_fog_of_a_series_is_as_good_as_ordered():
    scenes = [room(each) for each in (200.0, 50.0, 100.0)]
    lights = trace_fogs(scenes, PAPER, transport_noise_share=1.0, seeds=range(3))
    assert lights[1].reweighted is None
    assert sum(each.reweighted is not None for each in lights) >= 1
    for light in lights:
        assert light.noise_share <= 1.0
        assert light.spot_noise_share <= 1.0
    for light, scene in zip(lights, scenes, strict=True):
        if light.reweighted is not None:
            own = solve(scene, PAPER, transport_noise_share=1.0, seed=9)
            errors = np.hypot(light.image_error, own.image_error)
            z = (light.image - own.image).sum() / np.linalg.norm(errors)
            assert abs(z) < 4
