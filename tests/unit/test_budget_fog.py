"""What an instrument reaches in fog, by its own method and by a fit, in closed form."""

from dataclasses import asdict

import numpy as np
import pytest
from scipy.constants import c

from instruments import changed
from reconstruction.ranging.fog.overlap import overlap
from spisim.atmosphere import Atmosphere, fog, henyey_greenstein
from spisim.budget import Target, fog_budget, range_sigma_m, spot_link
from spisim.instrument import Instrument, list_presets, load_instrument

LIMIT_M = 0.01
FOG = fog(50.0, "moderate-radiation")


def target(distance_m: float, air: Atmosphere, klx: float = 10.0) -> Target:
    return Target(distance_m, 0.5, klx, air.extinction_per_m)


def test_share_and_bias_are_those_of_the_phasors() -> None:
    """Y = wall + echo at 15 MHz; the phase of the sum against that of the wall."""
    paper = load_instrument("paper")
    there, per_m = target(4.0, FOG), 2 * np.pi * 15e6 / c
    result = fog_budget(paper, there, FOG, LIMIT_M)
    link = spot_link(paper, there)
    z = 4.0 / paper.lasers.directions[0, 2]
    edges = np.linspace(0.2, z, 4001)
    weight, path_m = (each[0] for each in overlap(paper.spot_optics, (edges[1:] + edges[:-1]) / 2))
    coefficient = FOG.scattering_per_m * FOG.backscatter_per_sr
    echo = coefficient * weight * np.exp(-FOG.extinction_per_m * path_m) * np.diff(edges)
    echo *= paper.lasers.power_w * paper.spot_optics.electrons_per_joule
    wall = link.echo_per_s[0]
    assert result.echo_fraction == pytest.approx(echo.sum() / (echo.sum() + wall), rel=0.01)
    phasor = wall + (echo * np.exp(1j * per_m * (path_m - link.path_m[0]))).sum()
    bias_m = np.angle(phasor) / per_m * link.range_per_path[0]
    assert bias_m < -0.3
    assert result.plain_bias_m == pytest.approx(bias_m, rel=0.01)


@pytest.mark.parametrize("name", ["paper", "hybrid"])
def test_fog_that_only_absorbs_has_no_echo(name: str) -> None:
    """Then a fit is as good as the plain method, and reaches as far as a limit has it."""
    instrument = load_instrument(name)
    dark = Atmosphere(0.05, 0.0, henyey_greenstein(0.8), "absorbing")
    there = target(3.0, dark)
    result = fog_budget(instrument, there, dark, LIMIT_M)
    assert result.echo_fraction == 0
    assert result.plain_bias_m == pytest.approx(0, abs=2e-3)
    assert result.sigma_m == pytest.approx(range_sigma_m(instrument, there).max(), rel=1e-3)


def test_at_the_longest_range_the_bound_is_the_limit() -> None:
    preset = load_instrument("fog")
    longest = fog_budget(preset, target(5.0, FOG), FOG, LIMIT_M).longest_m
    assert longest is not None
    assert longest > 7
    there, nearer = (
        fog_budget(preset, target(distance_m, FOG), FOG, LIMIT_M) for distance_m in (longest, 3.0)
    )
    assert there.sigma_m == pytest.approx(LIMIT_M, rel=0.01)
    assert nearer.sigma_m < there.sigma_m
    assert nearer.reflectance_sigma < there.reflectance_sigma
    assert 0 < nearer.extinction_sigma < 1


@pytest.mark.slow
def test_several_frequencies_and_single_photons_see_through_what_one_cannot() -> None:
    sigmas = [
        fog_budget(load_instrument(name), target(6.0, FOG, 1.0), FOG, LIMIT_M).sigma_m
        for name in ("fog", "fog-spad", "paper")
    ]
    assert max(sigmas[:2]) < 0.01
    assert sigmas[2] > 0.5


@pytest.mark.slow
def test_strong_fog_is_the_strongest_pulse() -> None:
    """A dark wall behind the fog that begins where beam and field meet."""
    single = changed("spad", lasers__power_w=25e-3)
    air = fog(20.0, "moderate-radiation")
    bias_m = fog_budget(
        single, Target(8.0, 0.1, 0.0, air.extinction_per_m), air, LIMIT_M
    ).plain_bias_m
    assert bias_m is not None
    assert bias_m < -5


@pytest.mark.slow
@pytest.mark.parametrize("name", list_presets())
def test_every_preset_has_one(name: str) -> None:
    instrument = load_instrument(name)
    distance_m = min(4.0, 0.8 * instrument.ranging.tof.unambiguous_range_m)
    result = asdict(fog_budget(instrument, target(distance_m, FOG), FOG, LIMIT_M))
    assert 0 < result["echo_fraction"] < 1
    if getattr(instrument.ranging.tof, "threshold_sigma", None) is not None:
        assert result["sigma_m"] is result["longest_m"] is None  # no fit of fog to such stamps
        return
    assert result["sigma_m"] > 0
    assert result["longest_m"] >= 0


def thresholded(sigmas: float) -> Instrument:
    """Stamps of a current that crosses a threshold of so many of its noise."""
    return changed(
        "apd",
        tof={
            **load_instrument("fog-spad").tof.model_dump(include={
                "method", "pulse_fwhm_s", "pulses", "repetition_rate_hz", "bin_width_s", "bins"}),
            "threshold_sigma": sigmas,
            "detector": {
                **load_instrument("apd").tof.detector.model_dump(exclude_none=True),
                "amplifier": {"noise_pa_per_sqrt_hz": 2.0, "bandwidth_hz": 200e6},
            },
        },
    )  # fmt: skip


def test_stamps_of_thresholds_have_no_bound() -> None:
    """They do not show how much light the fog sends back."""
    stamps = thresholded(5.0)
    result = fog_budget(stamps, target(4.0, FOG), FOG, LIMIT_M)
    assert result.sigma_m is None
    assert result.longest_m is None


def test_false_alarms_of_a_threshold_take_cycles_away_at_the_rate_of_rice() -> None:
    """B / √(2 ln 2) exp(-t² / 2) a second: of a stamp at a path L, exp(-rate L / c) are left."""
    stamping = thresholded(2.0).tof.stamping
    lengths_m = np.array([0.0, 30.0])
    near, far = stamping.sigma_s(lengths_m, np.full(2, 1e13), np.zeros(2))
    rate_hz = stamping.bandwidth_hz / np.sqrt(2 * np.log(2)) * np.exp(-(2.0**2) / 2)
    assert (far / near) ** 2 == pytest.approx(np.exp(rate_hz * 30.0 / c), rel=1e-9)
