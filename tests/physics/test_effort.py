"""Errors of the light next to the detectors' noise: as ordered, and true."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import spisim
import worlds
from reconstruction.operators import decoder_for, expose
from spisim.simulation.light.solve import MIN_IMAGES, MIN_PATHS, Transport, solve
from spisim.simulation.light.spots import FIRST_SPOT_PATHS
from spisim.simulation.measurement.diagnostics import truth_warnings

PAPER = spisim.load_instrument("paper")
SCENE = worlds.scene(*worlds.room(), extinction_per_m=0.3, g=0.8, albedo=0.98)
FRACTION = 1.0
RUNS = 12


@cache
def runs() -> tuple[Transport, ...]:
    seeds = range(RUNS)
    return tuple(solve(SCENE, PAPER, transport_noise_share=FRACTION, seed=seed) for seed in seeds)


def test_the_share_is_reached_and_not_by_far() -> None:
    for run in runs():
        assert 0.3 * FRACTION < run.noise_share <= FRACTION
        assert 0.05 * FRACTION < run.spot_noise_share <= FRACTION


def test_the_share_is_that_of_the_scatter_of_recorded_coefficients() -> None:
    """Detector noise by its closed form, from the light of all runs; errors by their scatter."""
    gain = PAPER.electrons_per_joule(PAPER.detector, "projector") * PAPER.exposure_time_s
    plan = PAPER.pattern_plan
    decoder = decoder_for(plan)
    readings = np.array([expose(plan, run.image * PAPER.pixel_powers_w) * gain for run in runs()])
    readings *= 1 - PAPER.projector.dark_level
    dark = PAPER.detector.dark_electrons(PAPER.exposure_time_s)
    noise = PAPER.detector.electronics_noise_electrons(PAPER.exposure_time_s)
    variance = readings.mean(axis=0) + len(PAPER.detector.positions_m) * dark + noise**2
    coefficients = decoder.decode(readings)
    of_detector = decoder.own_variance(variance)
    own = of_detector > 0
    fraction = np.sqrt(np.mean(coefficients.var(axis=0, ddof=1)[own] / of_detector[own]))
    reported = np.sqrt(np.mean([run.noise_share**2 for run in runs()]))
    assert fraction == pytest.approx(reported, rel=0.25)


def test_a_small_share_takes_more_paths() -> None:
    fine = solve(SCENE, PAPER, transport_noise_share=FRACTION / 5)
    assert 3 < fine.paths / runs()[0].paths < 60
    assert fine.noise_share <= FRACTION / 5


def test_a_clear_scene_needs_the_fewest_paths_there_are() -> None:
    light = solve(worlds.scene(worlds.plane(4.0)), PAPER, transport_noise_share=0.3)
    spots = 8 * 4 * FIRST_SPOT_PATHS * 2
    spots = 8 * 4 * FIRST_SPOT_PATHS * 2
    assert light.paths == MIN_IMAGES * MIN_PATHS * PAPER.pattern_plan.pixels + spots
    assert light.noise_share < 0.3


def test_an_image_that_is_no_truth_is_told() -> None:
    light = solve(SCENE, PAPER, spp=1)
    (sentence,) = truth_warnings(light)
    assert re.search(r"known to \d+ % only.*transport_noise_share", sentence)
    assert truth_warnings(replace(light, image_error=light.image / 20)) == []
