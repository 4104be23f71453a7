"""Walls as dark as matter gets: alternatives keep weights that equal frequencies."""

from functools import cache

import numpy as np
import pytest

from fogs import light
from reconstruction.capture.schema import between
from reconstruction.ranging import Ranges, ranging_method
from reconstruction.ranging.fog.answer import MIN_PROBABILITY
from reconstruction.ranging.fog.target_prior import BEYOND, even_log_prior, surface_log_prior
from spisim.instrument import load_instrument

FOG = load_instrument("fog")
STEADY_PER_S = 1e10  # a sky of 5 klx


def measured(ranges_m, seed: int = 0, **scene) -> Ranges:
    received = light(FOG, ranges_m, steady_per_s=STEADY_PER_S, **scene)
    spots = FOG.tof.record(received, FOG.spot_optics, np.random.default_rng(seed))
    return solver()(spots)


@cache
def solver():
    received = light(FOG, 4.0)
    spots = between(FOG.tof.record(received, FOG.spot_optics, None), 0, 0)
    return ranging_method("fog", spots).compile(spots)


def weight_at(result: Ranges, spot: int, range_m: float) -> float:
    near = (each for each in result.alternatives[spot] if abs(each.range_m - range_m) < 0.1)
    return sum(each.weight for each in near)


@pytest.mark.parametrize("range_m", [2.0, 3.0, 4.0])
@pytest.mark.parametrize("reflectance", [0.016, 0.02, 0.023, 0.064])
def test_a_dark_wall_is_not_taken_for_a_far_one(reflectance: float, range_m: float) -> None:
    """Ice, water, old snow and black rubber straight ahead."""
    true_m = range_m / FOG.lasers.directions[:, 2]
    result = measured(true_m, reflectances=reflectance)
    assert (np.abs(result.range_m - true_m) < 0.1)[result.valid].all()
    weights = [weight_at(result, spot, each) for spot, each in enumerate(true_m)]
    assert np.mean(weights) > 0.2


@cache
def drawn() -> list[tuple[Ranges, np.ndarray]]:
    rng = np.random.default_rng(17)
    result = []
    for number in range(60):
        beyond = rng.random(4) < BEYOND
        true_m = rng.uniform(0.5, 10, 4) + 10 * beyond
        reflectances = np.exp(rng.uniform(np.log(0.01), np.log(0.9), 4))
        result.append((measured(true_m, number, reflectances=reflectances), true_m))
    return result


def test_weights_are_frequencies() -> None:
    """Of drawn walls of reflectance 0.01 to 0.9, in clear air: by thirds of the weight."""
    pairs = [
        (each.weight, abs(each.range_m - true_m) < 0.1 + 3 * each.sigma_m)
        for ranges, all_m in drawn()
        for some, status, true_m in zip(ranges.alternatives, ranges.status, all_m, strict=True)
        for each in some
        if status != "weak"
    ]
    weight, right = np.array(pairs, dtype=float).T
    for least, most in ((0.01, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 0.98), (0.98, 1.01)):
        here = (weight >= least) & (weight < most)
        expected = weight[here]
        z = (right[here] - expected).sum() / np.sqrt((expected * (1 - expected)).sum() + 1)
        assert abs(z) < 3.5, (least, z, expected.mean(), right[here].mean())


def test_what_is_ok_has_no_likely_alternative() -> None:
    result = [ranges for ranges, _ in drawn()]
    assert sum(each.status.count("ok") for each in result) > 0.6 * 4 * len(result)
    for ranges in result:
        for status, some, nothing in zip(
            ranges.status, ranges.alternatives, ranges.nothing, strict=True
        ):
            if status == "ok":
                assert sum(each.weight for each in some[1:]) <= 1 - MIN_PROBABILITY
                assert nothing <= 1 - MIN_PROBABILITY
            if some:
                assert sum(each.weight for each in some) == pytest.approx(1, abs=1e-2)


def test_that_nothing_is_there_has_a_probability() -> None:
    result = measured([3.0, np.inf, np.inf, 4.0])
    assert result.nothing[[0, 3]].max() < 1e-3
    assert result.nothing[[1, 2]].min() > 0.3


@pytest.mark.parametrize("log_prior", [surface_log_prior, even_log_prior])
def test_reflectances_have_a_density(log_prior) -> None:
    """Its logarithm integrates to 1, with some for surfaces as dark as water and ice."""
    log = np.linspace(np.log(1e-5), np.log(1e3), 200_001)
    density = np.exp(log_prior(np.exp(log)) + log)
    assert np.trapezoid(density, log) == pytest.approx(1, abs=1e-3)
    below = np.exp(log) < 0.03
    assert 0.05 < np.trapezoid(density[below], log[below]) < 0.2
