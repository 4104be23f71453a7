"""Ranging in fog: ranges and error bars of drawn readings, and what it says where it cannot know.

The light is that of four pencils in even fog, scattered once (see `fogs`).
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.constants import c

from fogs import light
from instruments import WINDOWS, changed
from reconstruction.base.errors import InputError
from reconstruction.capture import Spots
from reconstruction.capture.schema import between
from reconstruction.ranging import Alternative, Ranges, ranging_method
from spisim.instrument import Instrument, load_instrument

RANGES = np.array([3.0, 4.5, 5.5, 7.0])
FOG = {"extinction_per_m": 0.06, "backscatter_per_sr": 0.025}


@cache
def instrument(name: str) -> Instrument:
    if name == "windows":
        return changed("hybrid", **WINDOWS)
    if name == "gated":
        return changed("hybrid", **WINDOWS, tof__gate_delay_s=15e-9)
    if name == "photons":
        return changed("fog-spad", tof__bins=550)
    return load_instrument(name)


def record(name: str = "fog", ranges_m=RANGES, seed: int = 1, **scene) -> Spots:
    """Readings of a scene by an instrument."""
    tof, optics = instrument(name).tof, instrument(name).spot_optics
    scene = {"steady_per_s": 2e4 if name == "photons" else 1e8} | scene
    return tof.record(
        light(instrument(name), ranges_m, **scene), optics, np.random.default_rng(seed)
    )


def measure(spots: Spots, method: str = "fog") -> list[Ranges]:
    solve = ranging_method(method, spots).compile(between(spots, 0, 0))
    return [solve(between(spots, k, k + 1)) for k in range(len(spots.readings))]


def numbers(result: list[Ranges]) -> tuple[np.ndarray, np.ndarray]:
    """Ranges and their error bars, (frames, 4), all of them valid."""
    assert {status for each in result for status in each.status} == {"ok"}
    return np.array([each.range_m for each in result]), np.array([each.sigma_m for each in result])


# Ranges and error bars


@pytest.mark.parametrize(
    ("name", "frames"), [("fog", 100), ("windows", 100), ("gated", 100), ("photons", 20)]
)
def test_ranges_scatter_about_the_truth_as_sigma_says(name: str, frames: int) -> None:
    range_m, sigma_m = numbers(measure(record(name, frames=frames, **FOG)))
    z = (range_m - RANGES) / sigma_m
    assert np.abs(z.mean(axis=0)).max() * np.sqrt(frames) < 4, z.mean(axis=0)
    # What fog may deviate from being even is part of sigma, and is not of these readings.
    assert abs((z**2).mean() - 1) < 0.1 + 4 * np.sqrt(2 / z.size)


def test_the_plain_method_is_off_in_this_fog() -> None:
    result = measure(record("windows", frames=10, **FOG), "pulsed")
    z = [(each.range_m - RANGES) / each.sigma_m for each in result]
    assert np.nanmean(z) < -2


@pytest.mark.parametrize(("name", "frames"), [("fog", 40), ("photons", 10)])
def test_in_clear_air_it_is_the_plain_method(name: str, frames: int) -> None:
    spots = record(name, frames=frames)
    range_m, sigma_m = numbers(measure(spots))
    plain_m, plain_sigma_m = numbers(measure(spots, spots.method))
    apart = (range_m - plain_m) / plain_sigma_m
    assert np.sqrt((apart**2).mean(axis=0)).max() < 0.1
    np.testing.assert_allclose(sigma_m.mean(axis=0), plain_sigma_m.mean(axis=0), rtol=0.03)


def test_the_radiometric_scale_need_not_be_known() -> None:
    spots = record(**FOG)
    (given,) = measure(spots)
    (unknown,) = measure(replace(spots, electrons_per_joule=np.nan))
    assert unknown.status == ("ok",) * 4
    assert (np.abs(unknown.range_m - given.range_m) < 0.3 * given.sigma_m).all()
    np.testing.assert_allclose(unknown.sigma_m, given.sigma_m, rtol=0.1)


def test_steady_light_does_not_move_a_range() -> None:
    tof, optics = instrument("fog").tof, instrument("fog").spot_optics
    dark, bright = (
        measure(tof.record(light(instrument("fog"), RANGES, steady_per_s=s, **FOG), optics, None))
        for s in (0.0, 1e9)
    )
    np.testing.assert_allclose(dark[0].range_m, bright[0].range_m, atol=2e-3)
    np.testing.assert_allclose(dark[0].range_m, RANGES, atol=2e-3)


# Spots that are lost


def test_a_saturated_spot_is_left_out_and_the_others_stay() -> None:
    spots = record(**FOG)
    spots.saturated[0, 1, 5] = True
    (result,) = measure(spots)
    assert result.status == ("ok", "saturated", "ok", "ok")
    assert result.alternatives[1] == ()
    assert np.isnan(result.range_m[1])
    others = [0, 2, 3]
    assert (np.abs(result.range_m - RANGES) < 4 * result.sigma_m)[others].all()


def test_one_spot_alone_has_a_range_where_fog_lets_it() -> None:
    spots = record(**FOG)
    spots.saturated[0, 1:] = True
    (result,) = measure(spots)
    assert result.status == ("ok", *("saturated",) * 3)
    assert abs(result.range_m[0] - 3.0) < 4 * result.sigma_m[0]


@pytest.mark.parametrize("name", ["fog", "windows", "photons"])
def test_without_any_spot_there_is_no_range(name: str) -> None:
    spots = record(name, **FOG)
    spots.saturated[:] = True
    (result,) = measure(spots)
    assert result.status == ("saturated",) * 4
    assert np.isnan([result.range_m, result.sigma_m]).all()
    assert result.alternatives == ((), (), (), ())


def test_a_faint_target_in_clear_air_is_weak() -> None:
    spots = record(reflectances=[0.3, 0.3, 0.3, 1e-4], frames=20)
    result = measure(spots)
    assert all(each.status[:3] == ("ok",) * 3 for each in result)
    assert sum(each.status[3] == "weak" for each in result) >= 17
    assert "ok" not in {each.status[3] for each in result}


@pytest.mark.parametrize("name", ["fog", "windows", "photons"])
def test_without_fog_and_targets_there_is_no_range(name: str) -> None:
    result = measure(record(name, ranges_m=np.inf, frames=10))
    statuses = [status for each in result for status in each.status]
    assert "ok" not in statuses
    assert statuses.count("weak") > 0.8 * len(statuses)


def test_fog_without_a_target_gives_no_range() -> None:
    result = measure(record(ranges_m=[3.0, 4.5, 5.5, np.inf], frames=10, **FOG))
    assert {each.status[:3] for each in result} == {("ok",) * 3}
    assert {each.status[3] for each in result} <= {"fog", "weak"}


def test_a_bright_sky_without_a_target_gives_no_range() -> None:
    result = measure(record("photons", np.inf, frames=16, steady_per_s=1e7))
    assert "ok" not in {status for each in result for status in each.status}


def test_a_fog_bank_before_all_targets_is_seen_through() -> None:
    bank = {"extinction_per_m": 0.1, "backscatter_per_sr": 0.03, "fog_m": (2.0, np.inf)}
    result = measure(record(frames=20, **bank))
    valid = np.array([each.valid for each in result])
    z = np.array([(each.range_m - RANGES) / each.sigma_m for each in result])[valid]
    assert valid[:, :3].mean() > 0.8
    assert np.abs(z).max() < 4


def test_a_cloud_before_a_target_makes_no_range_wrong() -> None:
    ranges_m = np.random.default_rng(3).uniform(5, 8, (25, 4))
    cloud = {"extinction_per_m": 0.5, "backscatter_per_sr": 0.03, "fog_m": (1.0, 2.0)}
    each = [light(instrument("fog"), some, reflectances=0.2, **cloud) for some in ranges_m]
    echo = np.concatenate([one.echo_per_s for one in each])
    steady = np.concatenate([one.steady_per_s for one in each])
    tof, optics = instrument("fog").tof, instrument("fog").spot_optics
    given = replace(each[0], echo_per_s=echo, steady_per_s=steady)
    result = measure(tof.record(given, optics, np.random.default_rng(0)))
    wrong = np.abs(np.array([one.range_m for one in result]) - ranges_m) > 0.3
    assert np.count_nonzero(wrong) <= 1


def on_an_edge(name: str, extinction_per_m: float, frames: int = 10) -> list[Ranges]:
    """Spot 1 on a target at 4.5 m of reflectance 0.2 and on one at 3.8 m of 0.15, before it."""
    scene = {"extinction_per_m": extinction_per_m, "steady_per_s": 2e4, "frames": frames}
    behind = light(instrument(name), RANGES, reflectances=[0.3, 0.2, 0.3, 0.3], **scene)
    front = light(instrument(name), [0.2, 3.8, 0.2, 0.2], reflectances=[0, 0.15, 0, 0])
    damped = front.echo_per_s * np.exp(-2 * extinction_per_m * 3.8)
    given = replace(behind, echo_per_s=behind.echo_per_s + damped)
    tof, optics = instrument(name).tof, instrument(name).spot_optics
    return measure(tof.record(given, optics, np.random.default_rng(2)))


def has_both_sides(result: Ranges) -> bool:
    near, far = sorted(result.alternatives[1][:2])
    return abs(near.range_m - 3.8) < 0.03 and abs(far.range_m - 4.5) < 0.03


@pytest.mark.parametrize("extinction_per_m", [0.0, 0.04])
def test_a_spot_on_an_edge_is_ambiguous(extinction_per_m: float) -> None:
    for result in on_an_edge("fog", extinction_per_m):
        assert result.status[1] == "ambiguous"
        assert len(result.alternatives[1]) > 1
        weights = [each.weight for each in result.alternatives[1]]
        assert weights == sorted(weights, reverse=True)
        assert sum(weights) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    "extinction_per_m",
    [
        0.04,
        0.0,
    ],
)
def test_phases_of_a_spot_on_an_edge_tell_both_sides(extinction_per_m: float) -> None:
    assert sum(map(has_both_sides, on_an_edge("fog", extinction_per_m))) >= 7


@pytest.mark.parametrize("extinction_per_m", [0.0, 0.04])
def test_photons_of_a_spot_on_an_edge_tell_both_sides(extinction_per_m: float) -> None:
    assert all(map(has_both_sides, on_an_edge("photons", extinction_per_m, frames=4)))


def test_what_is_beyond_the_common_wrap_of_all_frequencies_looks_nearer() -> None:
    """As with the plain method, which says from where on."""
    wraps = changed(
        "fog", tof__modulation__frequencies_hz=[60e6, 120e6, 240e6], tof__periods=170_400
    )
    given = light(wraps, [1.5, 2.2, 4.0, 6.0])
    spots = wraps.tof.record(given, wraps.spot_optics, np.random.default_rng(1))
    repeats_m = ranging_method("fog", spots).unambiguous_range_m(spots)
    assert repeats_m == pytest.approx(c / 60e6 / 2)
    (result,) = measure(spots)
    (plain,) = measure(spots, "cw")
    true_m = np.array([1.5, 2.2, 4.0, 6.0])
    np.testing.assert_allclose(plain.range_m, true_m % repeats_m, atol=0.01)
    for spot, at_m in enumerate(true_m % repeats_m):
        possible_m = np.array([each.range_m for each in result.alternatives[spot]])
        assert np.abs(possible_m - at_m).min() < 0.01


@pytest.mark.parametrize("extinction_per_m", [0.0, 0.03])
def test_targets_beyond_the_unambiguous_range_are_seldom_taken_for_nearer_ones(
    extinction_per_m: float,
) -> None:
    """Their phases are those of nearer ones, which would be darker than most surfaces. Looked for
    in the first interval alone, all are wrong in clear air, and every other one in this fog."""
    rng = np.random.default_rng(3)
    wrong, possible, spots = 0, 0, 0
    for seed in range(40):
        true_m = rng.uniform(10.4, 12.4, 4)
        recorded = record(
            ranges_m=true_m,
            seed=seed,
            reflectances=rng.uniform(0.1, 0.8, 4),
            extinction_per_m=extinction_per_m,
            backscatter_per_sr=0.025,
        )
        (result,) = measure(recorded)
        wrong += np.count_nonzero(np.abs(result.range_m - true_m)[result.valid] > 0.1)
        possible += sum(
            any(abs(each.range_m - at) < 0.1 for each in some)
            for some, at in zip(result.alternatives, true_m, strict=True)
        )
        spots += 4
    assert wrong < 0.1 * spots
    assert possible > 0.7 * spots


@pytest.mark.parametrize(
    ("weights", "expected_m"),
    [
        ((0.6, 0.4, 0.0), 4.0),
        ((0.3, 0.7, 0.0), 14.0),
        ((0.4, 0.3, 0.3), 4.0),
        ((0.45, 0.0, 0.55), 4.0),
    ],
)
def test_the_likeliest_range_is_beyond_the_unambiguous_one_only_if_twice_as_probable(
    weights: tuple[float, ...], expected_m: float
) -> None:
    some = zip((4.0, 14.0, 16.0), weights, strict=True)
    unknown = np.array([np.nan])
    result = Ranges(
        *(4 * [unknown]),
        status=("ambiguous",),
        alternatives=(tuple(Alternative(at_m, 0.1, weight) for at_m, weight in some),),
        unambiguous_range_m=10.0,
    )
    range_m, sigma_m = result.likeliest
    assert range_m[0] == pytest.approx(expected_m)
    assert sigma_m[0] == pytest.approx(0.1)


def test_dark_targets_within_it_are_not_taken_for_brighter_ones_beyond() -> None:
    for result in measure(record(frames=10, reflectances=np.full(4, 0.05), **FOG)):
        assert (np.abs(result.range_m - RANGES) < 0.1)[result.valid].all()


# What is not known


@pytest.mark.parametrize("name", ["fog", "windows", "photons"])
@pytest.mark.parametrize(
    "lost",
    [
        "detector_axes",
        "half_fields_rad",
        "falloffs",
        "aperture_radii_m",
        "beam_divergence_rad",
        "beam_waist_m",
    ],
)
def test_geometry_that_is_not_known_is_named(name: str, lost: str) -> None:
    spots = record(name)
    values = np.array(getattr(spots, lost))
    values[(-1,) * values.ndim] = np.nan
    unknown = replace(spots, **{lost: values if values.ndim else np.nan})
    with pytest.raises(InputError, match=rf"spots/{lost} is unknown \(nan\)"):
        measure(unknown)


@pytest.mark.parametrize(
    ("name", "lost"),
    [
        ("fog", "laser_energies_j"),
        ("fog", "contrasts"),
        ("windows", "laser_energy_j"),
        ("photons", "laser_energy_j"),
        ("photons", "response_sigma_s"),
    ],
)
def test_light_that_is_not_known_is_refused(name: str, lost: str) -> None:
    with pytest.raises(InputError, match=r"unknown .*ranging in fog needs it"):
        measure(replace(record(name), **{lost: np.nan}))


def test_stamps_of_whole_pulses_are_refused() -> None:
    with pytest.raises(InputError, match="needs histograms of single photons"):
        measure(replace(record("photons"), piles_up=False))


def test_a_detector_that_never_sees_its_beam_is_named() -> None:
    spots = record(**FOG)
    away = spots.detector_axes.copy()
    away[2] = [0.6, 0.0, 0.8]
    with pytest.raises(InputError, match="detector of spot 2 sees nothing"):
        measure(replace(spots, detector_axes=away))


@pytest.mark.parametrize(
    ("name", "changes", "reported"),
    [
        (
            "photons",
            {"start_s": -1.0},
            r"readings end at -1\.5e\+08 m, but ranging in fog begins at",
        ),
        ("windows", {"delay_offset_s": -1.0}, "no echo from within 150 m reaches any reading"),
    ],
)
def test_times_that_no_light_can_have_are_refused(
    name: str, changes: dict[str, float], reported: str
) -> None:
    with pytest.raises(InputError, match=reported):
        measure(replace(record(name), **changes))


# Answers


def test_the_likeliest_range_of_several_is_their_mean_and_spread() -> None:
    ranges = Ranges(
        range_m=np.array([2.0, np.nan, np.nan, np.nan]),
        sigma_m=np.array([0.1, np.nan, np.nan, np.nan]),
        signal_electrons=np.ones(4),
        background_electrons=np.ones(4),
        status=("ok", "ambiguous", "saturated", "fog"),
        alternatives=(
            (Alternative(2.0, 0.1, 0.95), Alternative(9.0, 0.1, 0.05)),
            (Alternative(2.0, 0.3, 0.6), Alternative(4.0, 0.4, 0.2)),
            (),
            (Alternative(5.0, 0.7, 1.0),),
        ),
    )
    mean, sigma = ranges.likeliest
    np.testing.assert_allclose(mean, [2.0, 2.5, np.nan, 5.0])
    # 3/4 (0.3^2 + 0.5^2) + 1/4 (0.4^2 + 1.5^2)
    np.testing.assert_allclose(sigma, [0.1, np.sqrt(0.255 + 0.6025), np.nan, 0.7])
    assert np.isnan(ranges.range_m[1])  # as it was
