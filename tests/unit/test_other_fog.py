"""Fog of another extinction from the paths of one pass: what carries it, and what is refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import worlds
from reconstruction.base.errors import InputError
from spisim.simulation.light import fogs
from spisim.simulation.light.fogs import MAX_OTHERS, trace_fogs
from spisim.simulation.light.other_fog import (
    MIN_CARRIED,
    NEIGHBOURS,
    OtherFog,
    Reweighted,
    in_each,
    over_fogs,
)
from spisim.transport.engine.sampling import ErrorMetric, Estimate

VISIBILITY_M = 50.0


def foggy(visibility_m=VISIBILITY_M, **changes):
    scene = worlds.scene(worlds.plane(4.0), extinction_per_m=4.0 / visibility_m, g=0.8)
    fog = replace(scene.atmosphere, visibility_m=visibility_m, **changes)
    return replace(scene, atmosphere=fog)


def test_the_other_fog_has_its_extinction_visibility_and_water():
    other = OtherFog.of_visibility(foggy(water_g_per_m3=0.2), 2 * VISIBILITY_M)
    assert other.ratio == 0.5
    fog = other.scene.atmosphere
    assert fog.extinction_per_m == pytest.approx(0.04)
    assert (fog.visibility_m, fog.water_g_per_m3) == (2 * VISIBILITY_M, 0.1)


def test_the_fog_of_another_scene_gives_the_same_ratio():
    assert OtherFog.between(foggy(), foggy(100.0)).ratio == pytest.approx(0.5)


@pytest.mark.parametrize(
    "change", [{"albedo": 0.5}, {"phase": worlds.scene(g=0.1).atmosphere.phase}]
)
def test_other_droplets_are_refused(change):
    other = replace(foggy(100.0).atmosphere, **change)
    with pytest.raises(InputError, match="paths through one say nothing of the other"):
        OtherFog.between(foggy(), replace(foggy(), atmosphere=other))


def test_another_pose_is_refused():
    moved = np.eye(4)
    moved[0, 3] = 0.1
    with pytest.raises(InputError, match="from another pose"):
        OtherFog.between(foggy(), replace(foggy(100.0), drone_pose=moved))


@pytest.mark.parametrize("ratio", [0.0, -1.0, np.inf, np.nan])
def test_a_ratio_that_is_none_is_refused(ratio):
    with pytest.raises(InputError, match=r"ratio = .*must be positive and finite"):
        OtherFog.of(foggy(), ratio)
    with pytest.raises(InputError, match="that of the scene's fog is unknown"):
        OtherFog.of_visibility(worlds.scene(extinction_per_m=0.1), 20.0)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (worlds.scene(worlds.plane(4.0)), "the air is clear"),
        (replace(foggy(), volumes=worlds.bank(0.1)), "remove other weather and volumes"),
    ],
)
def test_a_scene_without_fog_alone_is_refused(scene, message):
    for refused in (
        lambda: OtherFog.of(scene, 2.0),
        lambda: OtherFog.between(foggy(), scene),
        lambda: OtherFog.between(scene, foggy()),
    ):
        with pytest.raises(InputError, match=message):
            refused()


def sums_of(name, values, weights, ending):
    """Sums of a tally over paths (paths, cells), plain and weighted."""
    return {
        name: values.sum(axis=0),
        f"{name}{ending}": (values * weights).sum(axis=0),
        f"{name}{ending}_squared": (values * weights**2).sum(axis=0),
    }


def test_equal_weights_are_carried_by_all_paths():
    other = OtherFog.of(foggy(), 2.0)
    values = np.random.default_rng(0).random((100, 4))
    sums = sums_of("image", values, 0.3, other.ending)
    assert other.carried_image(sums) == pytest.approx(1)


def test_paths_that_carry_are_counted_as_in_a_survey():
    other = OtherFog.of(foggy(), 2.0)
    weights = np.where(np.arange(100) < 25, 4.0, 0.0)[:, None]
    sums = sums_of("image", np.ones((100, 4)), weights, other.ending)
    assert other.carried_image(sums) == pytest.approx(0.25)


def test_what_pixels_of_other_ranges_gain_is_no_uncertainty():
    other = OtherFog.of(foggy(), 2.0)
    weights = np.repeat([1.0, 0.1], NEIGHBOURS)
    sums = sums_of("image", np.ones((100, 2 * NEIGHBOURS)), weights, other.ending)
    assert other.carried_image(sums) == pytest.approx(1)
    mixed = sums_of("image", np.ones((100, 2 * NEIGHBOURS)), np.tile([1.0, 0.1], 8), other.ending)
    assert other.carried_image(mixed) == pytest.approx(0.55**2 / 0.505)
    assert other.carried_image({name: 0 * each for name, each in sums.items()}) == 1
    sums[f"image{other.ending}"] = np.full(2 * NEIGHBOURS, np.nan)
    assert other.carried_image(sums) == 0


def test_the_spot_that_fewest_paths_carry_counts_and_dark_ones_do_not():
    other = OtherFog.of(foggy(), 2.0)
    values = np.ones((10, 3, 5)) * [[[1.0], [1.0], [0.0]]]
    weights = np.ones((10, 3, 5))
    weights[5:, 1] = 0.0
    sums = sums_of("histogram", values, weights, other.ending)
    assert other.carried_spots(sums) == pytest.approx(0.5)
    sums[f"histogram{other.ending}"] = np.full((3, 5), np.nan)
    assert other.carried_spots(sums) == 0


@pytest.mark.parametrize("ratio", [0.5, 1.8])
def test_a_refusal_says_how_far_the_paths_carry(ratio):
    close = Reweighted(ratio, MIN_CARRIED)
    assert close.require_carried() == MIN_CARRIED
    assert close.limit == pytest.approx(ratio)
    far = Reweighted(ratio, 0.1)
    assert abs(far.limit - 1) < abs(ratio - 1)
    with pytest.raises(InputError, match=rf"10% of the paths .*about {far.limit:.2g} times"):
        far.require_carried()
    with pytest.raises(InputError, match="0% of the paths carry the estimate, at least 25%"):
        Reweighted(8.0, 0.0).require_carried()


def metric(noise):
    return ErrorMetric(lambda sums: sums["image"], lambda mean, error: float(error.max() / noise))


def test_the_largest_error_for_which_more_paths_pay_decides():
    others = [OtherFog.of(foggy(), ratio) for ratio in (1.2, 0.5)]
    joint = over_fogs([metric(1.0), metric(1.0), metric(2.0)], others)
    sums = {"image": np.ones(2)}
    sums |= {f"image{other.ending}": np.full(2, other.ratio) for other in others}
    np.testing.assert_array_equal(joint.readings(sums), [[1, 1], [1.2, 1.2], [0.5, 0.5]])
    mean = np.ones((3, 2))
    assert joint.size(mean, np.full((3, 2), 0.1) * [[1.0], [1.3], [1.0]]) == pytest.approx(0.13)
    assert joint.size(mean, np.full((3, 2), 0.1) * [[1.0], [1.5], [1.0]]) == pytest.approx(0.1)
    assert joint.size(mean, np.full((3, 2), 0.1) * [[1.0], [np.nan], [1.0]]) == pytest.approx(0.1)
    assert over_fogs([metric(1.0)], []).size(mean, 0.2 * mean) == pytest.approx(0.2)


def test_estimates_in_each_fog_have_its_sums_and_its_size():
    other = OtherFog.of(foggy(), 0.5)
    names = ("image", f"image{other.ending}", f"image{other.ending}_squared")
    mean = {name: np.full(2, k) for k, name in enumerate(names)}
    readings = np.ones((2, 2)), np.array([[0.1, 0.1], [0.3, 0.3]])
    result = Estimate(mean, mean, 8, 100, 0.3, 0, readings)
    own, there = in_each(result, [metric(1.0), metric(1.0)], [other])
    assert own.size == pytest.approx(0.1)
    assert own.mean is mean
    assert there.size == pytest.approx(0.3)
    assert set(there.mean) == {"image"}
    assert there.mean["image"][0] == 1
    assert in_each(result, [metric(1.0)], []) == [result]


def lights_in(monkeypatch, carried_down_to, fail=()):
    """Passes whose paths carry fog down to a fraction of the extinction, without tracing."""
    passes = []

    def solve_fogs(scene, instrument, others, *, transport_noise_share, seed, outputs):
        visibility_m = scene.atmosphere.visibility_m
        if others and visibility_m in fail:
            raise InputError("too bright")
        passes.append((visibility_m, seed))
        share = transport_noise_share
        own = SimpleNamespace(reweighted=None, seed=seed)
        return own, *(
            SimpleNamespace(
                reweighted=Reweighted(each.ratio, 0.9 if each.ratio >= carried_down_to else 0.1),
                noise_share=np.nan,
                spot_noise_share=share,
                seed=seed,
            )
            for each in others
        )

    monkeypatch.setattr(fogs, "solve_fogs", solve_fogs)
    return passes


INSTRUMENT = SimpleNamespace(tap_frequencies_hz=())


def traced(visibilities_m):
    scenes = [foggy(each) for each in visibilities_m]
    seeds = range(len(scenes))
    return trace_fogs(scenes, INSTRUMENT, transport_noise_share=0.3, seeds=seeds)


def test_the_thickest_fog_is_traced_and_thinner_ones_follow(monkeypatch):
    passes = lights_in(monkeypatch, carried_down_to=0.45)
    lights = traced([160.0, 20.0, 40.0, 80.0])
    assert passes == [(20.0, 1), (80.0, 3)]
    assert [each.reweighted and each.reweighted.ratio for each in lights] == [0.5, None, 0.5, None]
    assert [each.seed for each in lights] == [3, 1, 1, 3]


def test_fogs_out_of_range_are_each_traced(monkeypatch):
    passes = lights_in(monkeypatch, carried_down_to=0.9)
    assert all(each.reweighted is None for each in traced([40.0, 60.0, 160.0]))
    assert [visibility_m for visibility_m, _ in passes] == [40.0, 60.0, 160.0]


def test_a_pass_with_too_much_light_to_weight_is_made_alone(monkeypatch):
    passes = lights_in(monkeypatch, carried_down_to=0.1, fail=(40.0,))
    lights = traced([40.0, 60.0, 80.0])
    assert [visibility_m for visibility_m, _ in passes] == [40.0, 60.0]
    assert [each.reweighted is None for each in lights] == [True, True, False]


def test_a_pass_carries_few_fogs_at_most(monkeypatch):
    passes = lights_in(monkeypatch, carried_down_to=0.01)
    traced(100.0 + np.arange(2 * MAX_OTHERS + 2.0))
    assert len(passes) == 2


def test_an_error_larger_than_ordered_is_not_accepted(monkeypatch):
    lights_in(monkeypatch, carried_down_to=0.1)
    plain = fogs.solve_fogs

    def noisier(*arguments, transport_noise_share, **others):
        return plain(*arguments, transport_noise_share=1.01 * transport_noise_share, **others)

    monkeypatch.setattr(fogs, "solve_fogs", noisier)
    assert all(each.reweighted is None for each in traced([40.0, 50.0]))
