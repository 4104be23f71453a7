"""Ranges of a single frequency, which cannot tell fog from a target, by the prior over weather."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fogs import light
from instruments import changed
from reconstruction.base.errors import InputError
from reconstruction.capture import Optics, Spots
from reconstruction.capture.schema import between
from reconstruction.ranging import (
    RANGED,
    Brightness,
    Ranges,
    Weather,
    brightness_at,
    measure_ranges,
    ranging_method,
    usual_rangings,
)
from reconstruction.ranging.brightness import bucket_optics
from reconstruction.ranging.fog.modes import BACKSCATTER_PER_SR, LOG_SIGMA
from reconstruction.ranging.fog.overlap import overlap
from reconstruction.ranging.fog.target_prior import REFLECTANCE_LOG_SIGMA, REFLECTANCE_MEDIAN
from reconstruction.ranging.fog.underdetermined import CLEAR
from spisim.instrument import load_instrument
from spisim.simulation.measurement import recorded_optics

RANGES = np.array([3.0, 4.5, 5.5, 7.0])


def stated(spots: Spots, weather: str | float) -> Spots:
    return replace(spots, **Weather.parsed(weather)._asdict())


def record(ranges_m=RANGES, seed: int = 1, **scene) -> Spots:
    paper = load_instrument("paper")
    received = light(paper, ranges_m, **scene)
    return paper.tof.record(received, paper.spot_optics, np.random.default_rng(seed))


def measure(
    spots: Spots, optics: Optics | None = None, brightness: Brightness | None = None
) -> Ranges:
    return ranging_method("fog", spots).compile(between(spots, 0, 0), optics)(spots, brightness)


def pictured(spots: Spots, reflectance: float = 0.3) -> Ranges:
    """With the image that clear air makes of the targets."""
    optics = recorded_optics(load_instrument("paper"))
    (seen,) = bucket_optics(optics, spots)
    surface = optics.pixel_electrons * reflectance / np.pi * np.diag(overlap(seen, RANGES)[0])
    return measure(spots, optics, Brightness(surface, 0.05 * surface))


@cache
def drawn(count: int, seed: int) -> list[tuple[np.ndarray, Ranges, Ranges]]:
    """True, default and plain ranges of weather, surfaces and ranges as the prior has them."""
    rng = np.random.default_rng(seed)
    result = []
    solve = ranging_method("fog", record()).compile(between(record(), 0, 0))
    for number in range(count):
        ranges_m = rng.uniform(0.5, 9.5, 4)
        foggy = rng.random() > CLEAR
        spots = record(
            ranges_m,
            number,
            reflectances=REFLECTANCE_MEDIAN
            * np.exp(REFLECTANCE_LOG_SIGMA * rng.standard_normal(4)),
            extinction_per_m=foggy * np.exp(rng.uniform(np.log(0.003), np.log(0.28))),
            backscatter_per_sr=BACKSCATTER_PER_SR * np.exp(LOG_SIGMA * rng.standard_normal()),
        )
        result.append((ranges_m, solve(spots), measure_ranges(spots)))
    return result


def within(result: list[tuple[np.ndarray, Ranges]], sigmas: float) -> float:
    away = [(each.range_m - true_m) / each.sigma_m for true_m, each in result]
    away = np.concatenate(away)
    return float((np.abs(away[np.isfinite(away)]) < sigmas).mean())


def test_sigma_holds_what_the_readings_leave_open_of_the_fog() -> None:
    cases = drawn(60, 3)
    fitted, plain = ([(case[0], case[n]) for case in cases] for n in (1, 2))
    assert 0.64 < within(fitted, 1) < 0.93  # sigma covers fog that differs between spots, too
    assert within(fitted, 2) > 0.92
    assert within(fitted, 3) > 0.99
    assert within(plain, 2) < 0.7
    ranged = np.concatenate([each.valid for _, each in fitted])
    assert ranged.mean() > 0.4
    error_m = np.concatenate([each.range_m - true_m for true_m, each in fitted])
    assert np.nanmedian(np.abs(error_m)) < 0.3


def test_the_status_says_what_a_range_rests_on() -> None:
    result = measure(record([2.0, 2.5, 3.0, 3.5], extinction_per_m=0.02))
    assert "weather prior" in result.status
    assert result.valid.tolist() == [status in RANGED for status in result.status]
    near = measure(stated(record([1.0, 1.0, 1.0, 1.0]), "clear"))
    assert near.status == ("ok",) * 4


def test_in_clear_air_sigma_is_a_little_wider_than_the_plain_one() -> None:
    spots = record()
    result, plain = pictured(spots), measure_ranges(spots)
    assert result.valid.all()
    assert (np.abs(result.range_m - plain.range_m) < result.sigma_m + plain.sigma_m).all()
    assert (result.sigma_m >= 0.95 * plain.sigma_m).all()
    assert np.median(result.sigma_m / plain.sigma_m) < 3


def test_stated_clear_the_plain_ranges_come_first() -> None:
    spots = record()
    assert usual_rangings(spots) == ("fog", "cw")
    assert usual_rangings(stated(spots, "clear")) == ("cw",)
    assert usual_rangings(stated(spots, "fog")) == ("fog", "cw")


def test_a_stated_visibility_tells_the_fog() -> None:
    spots = record(extinction_per_m=0.05)
    unknown, given = measure(spots), measure(stated(spots, 3.9 / 0.05))
    assert given.valid.sum() >= 3
    assert given.fog.log_sigma < 0.7 * unknown.fog.log_sigma
    assert given.fog.extinction_per_m == pytest.approx(0.05, rel=0.3)
    assert (np.abs(given.range_m - RANGES) < 3 * given.sigma_m)[given.valid].all()
    assert measure(stated(spots, "fog")).fog.extinction_per_m > unknown.fog.extinction_per_m


def test_the_image_tells_the_fog_that_two_numbers_cannot() -> None:
    """Pixels as bright as clear air makes them exclude fog, and brighter ones clear air."""
    optics = recorded_optics(load_instrument("paper"))
    spots = record(extinction_per_m=0.02)
    (seen,) = bucket_optics(optics, spots)
    surface = optics.pixel_electrons * 0.3 / np.pi * np.diag(overlap(seen, RANGES)[0])
    sigma = 0.05 * surface
    dim, bright = (
        measure(spots, optics, Brightness(gain * surface, sigma)).fog.extinction_per_m
        for gain in (1.0, 2.5)
    )
    assert 2 * dim < bright


@pytest.mark.parametrize("extinction_per_m", [0.0, 0.01, 0.05, 0.16])
def test_without_an_image_sigma_holds_any_fog(extinction_per_m: float) -> None:
    """Not only on average over the prior: of one fog, too. Ranges that are less sure are none."""
    rng = np.random.default_rng(5)
    away, wrong = [], 0
    solve = ranging_method("fog", record()).compile(between(record(), 0, 0))
    for number in range(25):
        ranges_m = rng.uniform(2, 8, 4)
        result = solve(
            record(
                ranges_m,
                number,
                reflectances=rng.uniform(0.1, 0.8, 4),
                extinction_per_m=extinction_per_m,
                backscatter_per_sr=BACKSCATTER_PER_SR,
            )
        )
        error_m = np.abs(result.range_m - ranges_m)[result.valid]
        away.extend(error_m / result.sigma_m[result.valid])
        wrong += np.count_nonzero(error_m > 0.3)
    assert wrong == 0
    assert np.mean(np.array(away) < 1) > 0.5
    assert np.mean(np.array(away) < 2) > 0.85


def test_an_image_says_nothing_of_spots_outside_of_it() -> None:
    image = np.arange(16.0).reshape(4, 4)
    result = brightness_at(np.array([[1, 1], [0, 3], [4, 1], [-3, 2]]), image, np.ones((4, 4)))
    np.testing.assert_allclose(result.electrons, [5.0, 4.5, np.nan, np.nan])
    optics = recorded_optics(load_instrument("paper"))
    spots = record()
    no_return = Brightness(np.full(4, np.nan), np.full(4, np.nan))
    np.testing.assert_allclose(
        measure(spots, optics, no_return).range_m, measure(spots, optics).range_m, rtol=1e-9
    )


def test_detectors_that_are_not_stated_leave_the_image_out() -> None:
    assert bucket_optics(None, record()) == ()
    assert bucket_optics(Optics(0.2, 0.2), record()) == ()


def test_targets_beyond_the_wrap_are_not_called_near() -> None:
    """The plain method puts them a wrap too near, and calls that "ok"."""
    far_m = [11.4, 11.8, 12.1, 12.3]
    spots = record(far_m, reflectances=0.5)
    assert "ok" in measure_ranges(spots).status
    assert not measure(spots).valid.any()


def test_two_windows_are_ranged_alike() -> None:
    hybrid = load_instrument("hybrid")
    received = light(hybrid, [1.2, 1.6, 2.0, 2.4], extinction_per_m=0.06)
    spots = hybrid.tof.record(received, hybrid.spot_optics, np.random.default_rng(1))
    result = measure(spots)
    away = (result.range_m - [1.2, 1.6, 2.0, 2.4]) / result.sigma_m
    assert (np.abs(away[result.valid]) < 4).all()


@pytest.mark.parametrize("weather", ["sunny", "", "-3", "nan", "1e9", 0.0])
def test_weather_that_is_none_is_refused(weather) -> None:
    with pytest.raises(InputError, match="allowed: unknown, clear, fog, or a visibility from 1 to"):
        Weather.parsed(weather)


def test_an_instrument_states_its_weather() -> None:
    assert np.isnan(load_instrument("paper").spot_optics.clear_probability)
    foggy = changed("paper", weather=80.0).spot_optics
    assert (foggy.clear_probability, foggy.visibility_m) == (0.0, 80.0)
    assert changed("paper", weather="clear").spot_optics.clear_probability == 1.0


def test_without_a_radiometric_scale_sigma_is_wider() -> None:
    """Then no reflectance is more likely than another, and no image can be compared."""
    spots = record(extinction_per_m=0.02)
    optics = recorded_optics(load_instrument("paper"))
    bright = Brightness(np.full(4, 1e4), np.full(4, 10.0))
    unscaled = replace(spots, electrons_per_joule=np.nan)
    scaled, free, seen = measure(spots), measure(unscaled), measure(unscaled, optics, bright)
    assert scaled.valid.any()
    assert not free.valid.any()  # a target a wrap farther is not too bright
    assert (free.likeliest[1] > 0.9 * scaled.likeliest[1])[scaled.valid].all()
    assert free.alternatives == seen.alternatives


def test_visibilities_beyond_the_grid_are_at_its_ends() -> None:
    hazy, thick = record(extinction_per_m=0.02), record(extinction_per_m=0.25)
    result = measure(stated(hazy, 20_000))
    np.testing.assert_allclose(result.range_m, measure_ranges(hazy).range_m, rtol=0.01)
    assert measure(stated(thick, 2)).fog.extinction_per_m > 0.25


def test_a_scale_of_the_image_that_is_off_is_part_of_sigma() -> None:
    """A common factor of 1.5 on all pixels must not be read as fog beyond what sigma says."""
    optics = recorded_optics(load_instrument("paper"))
    spots = record()
    (seen,) = bucket_optics(optics, spots)
    surface = optics.pixel_electrons * 0.3 / np.pi * np.diag(overlap(seen, RANGES)[0])
    result = measure(spots, optics, Brightness(1.5 * surface, 0.1 * surface))
    assert (np.abs(result.range_m - RANGES) < 3 * result.sigma_m)[result.valid].all()
