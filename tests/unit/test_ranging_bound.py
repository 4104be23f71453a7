"""The Cramér-Rao bound of ranges in fog, against closed forms and against numeric information."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from instruments import changed
from reconstruction.base.errors import InputError
from reconstruction.capture.schema import between
from reconstruction.ranging.bound import Targets, make_bound, make_bounds
from reconstruction.ranging.fog.overlap import overlap
from spisim.budget import Target, range_sigma_m, spot_link
from spisim.instrument import SpotLight, load_instrument

UNKNOWN, VAGUE = (np.inf, np.inf), (1.5, 0.6)
RANGE_M, REFLECTANCE = np.array([2.105, 3.305, 4.205, 2.805]), np.array([0.3, 0.6, 0.2, 0.5])
EXTINCTION, BACKSCATTER = 0.08, 0.0035
PATH_STEP_M, FOG_STEP_M = 0.002, 0.01
BARE = {"tof__detector__sensor__afterpulse_probability": 0.0}
SINGLE_PHOTONS = pytest.param("spad", BARE, marks=pytest.mark.slow)
WINDOWS = {
    "tof__windows": 8,
    "tof__pulse_width_s": 5e-9,
    "tof__rise_time_s": 0.0,
    "tof__repetition_rate_hz": 1e7,
    "lasers__power_w": 0.1,
}


def binned(path_m, rate, bins):
    """Rates by path length, each shared between the two bins about it."""
    position = path_m / PATH_STEP_M
    low = position.astype(int)
    return np.bincount(low, rate * (1 + low - position), bins) + np.bincount(
        low + 1, rate * (position - low), bins
    )


@cache
def seen(name, z):
    """Steps of the fog up to z; for their middles and z the overlap and path, (4, steps + 1)."""
    edges = np.append(np.arange(0, z, FOG_STEP_M), z)
    positions = np.append((edges[1:] + edges[:-1]) / 2, z)
    return np.diff(edges), *overlap(load_instrument(name).spot_optics, positions)


def received(instrument, name, range_m, reflectance, extinction, backscatter, steady):
    """Light that fog scattered once and of targets across the beams, by the definition."""
    bins = int(2 * RANGE_M.max() / PATH_STEP_M) + 100
    scale = instrument.lasers.power_w * instrument.spot_optics.electrons_per_joule
    echo = np.zeros((1, 4, bins))
    for spot, z in enumerate(range_m):
        steps_m, weight, path_m = seen(name, z)
        sent_back = np.append(backscatter * steps_m, reflectance[spot] / np.pi)
        rate = scale * weight[spot] * np.exp(-extinction * path_m[spot]) * sent_back
        echo[0, spot] = binned(path_m[spot], rate, bins)
    lengths = PATH_STEP_M * np.arange(bins)
    return SpotLight(lengths, echo, steady[None], instrument.lasers.power_w)


def recorded(instrument, light):
    """Mean readings (4, n), and what a capture tells of their response and noise."""
    optics = instrument.spot_optics
    noisy = instrument.tof.record(light, optics, np.random.default_rng(0))
    return instrument.tof.record(light, optics, None).readings[0], between(noisy, 0, 0)


def wall(instrument, target):
    """Light of a wall across the optical axis in clear air."""
    link = spot_link(instrument, target)
    bins = int(link.path_m.max() / PATH_STEP_M) + 100
    echo = [
        binned(path_m[None], rate[None], bins)
        for path_m, rate in zip(link.path_m, link.echo_per_s, strict=True)
    ]
    lengths = PATH_STEP_M * np.arange(bins)
    power_w = instrument.lasers.power_w
    return SpotLight(lengths, np.array(echo)[None], link.steady_per_s[None], power_w)


@pytest.mark.parametrize("name", ["paper", "fog", "hybrid", "spad"])
def test_in_clear_air_it_is_what_the_plain_method_scatters_by(name: str) -> None:
    """Of single photons too few to pile up, for else the level matters to the delay."""
    instrument = changed(name, **(BARE if name == "spad" else {}))
    target = Target(4.0, 0.3, 0.01 if name == "spad" else 10.0)
    readings, spots = recorded(instrument, wall(instrument, target))
    cosine = instrument.lasers.directions[:, 2]
    there = Targets(4.0 / cosine, 0.3 * cosine)
    sigma_m = make_bound(spots, 5.0)(there, readings)
    assert sigma_m == pytest.approx(range_sigma_m(instrument, target), rel=2e-3)
    assert make_bound(spots, 5.0, UNKNOWN)(there, readings) == pytest.approx(sigma_m)


@pytest.mark.parametrize(("name", "changes"), [("paper", {}), ("hybrid", WINDOWS), SINGLE_PHOTONS])
def test_in_fog_it_is_the_inverse_of_numeric_information(name: str, changes: dict) -> None:
    """Of all 14 parameters, by what the simulated instrument records of light that differs."""
    instrument = changed(name, **changes)
    tof = instrument.tof
    steady = np.full(4, spot_link(instrument, Target(4.0, 0.3, 1.0)).steady_per_s.mean())
    optics = instrument.spot_optics

    def mean(theta: np.ndarray) -> np.ndarray:
        z, log_rho, log_steady, fog = theta[:4], theta[4:8], theta[8:12], np.exp(theta[12:])
        light = received(instrument, name, z, np.exp(log_rho), *fog, np.exp(log_steady))
        spots = tof.record(light, optics, None)
        return spots.electrons(spots.taps[0]) if name != "spad" else spots.counts[0]

    at = np.concatenate(
        [RANGE_M, np.log(REFLECTANCE), np.log(steady), np.log([EXTINCTION, BACKSCATTER])]
    )
    step = np.where(np.arange(14) < 4, 1e-3, 1e-4)
    slopes = np.array(
        [(mean(at + move) - mean(at - move)) / (2 * step[k])
         for k, move in enumerate(np.diag(step))]
    )  # fmt: skip
    light = received(instrument, name, RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER, steady)
    readings, spots = recorded(instrument, light)
    if name == "spad":
        rest = tof.pulses - readings.sum(axis=-1)
        information = np.einsum("asn,bsn->ab", slopes / np.maximum(readings, 1e-12), slopes)
        gone = slopes.sum(axis=-1)
        information += (gone / rest) @ gone.T
    else:
        variance = spots.variance(spots.electrons(readings))
        information = np.einsum("asn,bsn->ab", slopes / variance, slopes)
    information[12, 12] += VAGUE[0] ** -2
    information[12:, 12:] += np.array([[1, -1], [-1, 1]]) * VAGUE[1] ** -2
    scale = np.sqrt(np.diagonal(information))
    inverse = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    targets = Targets(RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER)
    result, expected = (
        make_bounds(spots, 5.0, VAGUE)(targets, readings),
        np.sqrt(inverse.diagonal()),
    )
    assert result.range_m == pytest.approx(expected[:4], rel=0.02)
    assert result.log_reflectance == pytest.approx(expected[4:8], rel=0.02)
    assert result.log_extinction == pytest.approx(expected[12], rel=0.02)


def test_what_is_known_beforehand_narrows_it() -> None:
    """Up to fog that is known, where neither spots nor coefficients depend on each other."""
    paper = changed("paper")
    light = received(paper, "paper", RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER, np.full(4, 1e9))
    readings, spots = recorded(paper, light)
    targets = Targets(RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER)
    sigmas = [
        make_bound(spots, 5.0, prior)(targets, readings)
        for prior in ((10.0, 10.0), VAGUE, (0.1, 0.1), (1e-9, 1e-9))
    ]
    assert (np.diff(sigmas, axis=0) < 0).all()
    dark = replace(targets, reflectance=REFLECTANCE * [1, 1e-9, 1e-9, 1e-9])
    alone = make_bound(spots, 5.0, (1e-9, 1e-9))(dark, readings)
    assert alone[0] == pytest.approx(sigmas[-1][0])


@pytest.mark.parametrize("name", ["paper", "fog"])
def test_other_spots_tell_of_the_fog_if_there_are_frequencies_enough(name: str) -> None:
    """Range and reflectance take both components of a single phasor, and none is left for it."""
    instrument = changed(name)
    steady = np.full(4, 1e9)
    light = received(instrument, name, RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER, steady)
    readings, spots = recorded(instrument, light)
    targets = Targets(RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER)
    blind = replace(spots, aperture_radii_m=spots.aperture_radii_m * [1.0, 1e-6, 1e-6, 1e-6])
    alone, together = (make_bound(each, 5.0)(targets, readings)[0] for each in (blind, spots))
    if name == "paper":
        assert alone == pytest.approx(together, rel=1e-3)
    else:
        assert alone > 1.01 * together


def test_what_the_capture_has_to_tell() -> None:
    paper = changed("paper")
    _, spots = recorded(paper, wall(paper, Target(4.0)))
    with pytest.raises(InputError, match="spots/half_fields_rad is unknown"):
        make_bound(replace(spots, half_fields_rad=np.full(4, np.nan)), 5.0)
    for unknown in ("electrons_per_joule", "laser_energies_j", "contrasts"):
        with pytest.raises(InputError, match="light in each reading is unknown"):
            make_bound(replace(spots, **{unknown: np.nan}), 5.0)


def test_frames_together_know_the_extinction_better() -> None:
    """Without a prior by the root of their number; with one at least as well as it."""
    fog = changed("fog")
    light = received(fog, "fog", RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER, np.full(4, 1e9))
    readings, spots = recorded(fog, light)
    targets = Targets(RANGE_M, REFLECTANCE, EXTINCTION, BACKSCATTER)

    def sigma(prior: tuple[float, float], frames: int) -> float:
        return make_bounds(spots, 5.0, prior, frames)(targets, readings).log_extinction

    assert sigma(UNKNOWN, 1) == pytest.approx(3 * sigma(UNKNOWN, 9))
    assert sigma((np.inf, 1e-6), 1) < sigma((np.inf, 0.1), 1) < sigma(UNKNOWN, 1)
    assert sigma((0.05, np.inf), 1) < 0.05
