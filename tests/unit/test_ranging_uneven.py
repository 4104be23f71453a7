"""Fog that differs between spots: what they do not share must not make their ranges wrong."""

from dataclasses import replace

import numpy as np
import pytest

from fogs import light
from reconstruction.capture.schema import between
from reconstruction.ranging import (
    Alternative,
    Ranges,
    Weather,
    range_consistency,
    ranging_method,
)
from reconstruction.ranging.fog.posterior import SpotPosterior
from reconstruction.ranging.fog.uneven import STANDS_OUT, UNEVEN, mixed, probability_of_uneven
from spisim.instrument import load_instrument

EXTINCTION_PER_M = 0.25  # a visibility of 16 m


def of_banks(preset: str, frames: int) -> list[tuple[np.ndarray, Ranges]]:
    """True and reported ranges, with a bank before the first two of four spots."""
    instrument = load_instrument(preset)
    rng = np.random.default_rng(31)
    result, solve = [], None
    for number in range(frames):
        true_m = rng.uniform(3, 9, 4)
        scene = {"reflectances": rng.uniform(0.1, 0.8, 4), "steady_per_s": 1e9}
        bank_m = rng.uniform(0, 2), rng.uniform(3, 8)
        foggy = light(instrument, true_m, extinction_per_m=EXTINCTION_PER_M, fog_m=bank_m, **scene)
        clear = light(instrument, true_m, **scene)
        echo_per_s = np.concatenate([foggy.echo_per_s[:, :2], clear.echo_per_s[:, 2:]], axis=1)
        spots = instrument.tof.record(
            replace(clear, echo_per_s=echo_per_s),
            instrument.spot_optics,
            np.random.default_rng(number),
        )
        solve = solve or ranging_method("fog", spots).compile(between(spots, 0, 0))
        result.append((true_m, solve(spots)))
    return result


@pytest.mark.parametrize(("preset", "valid"), [("fog", 0.5), ("paper", 0.05)])
def test_a_bank_before_two_of_four_spots_makes_hardly_a_range_wrong(preset, valid) -> None:
    """If all spots have to share one fog, 5 % of those of `fog` are, and a third of `paper`'s."""
    result = of_banks(preset, 80)
    wrong = [np.abs(each.range_m - true_m)[each.valid] > 0.3 for true_m, each in result]
    assert np.concatenate(wrong).size > valid * 4 * len(result)
    assert np.concatenate(wrong).sum() <= 2
    if preset == "fog":
        assert sum(each.status.count("uneven fog") for _, each in result) > len(result) / 10


def test_one_fog_for_all_spots_is_not_called_uneven() -> None:
    instrument = load_instrument("fog")
    given = light(instrument, [3.0, 4.5, 5.5, 7.0], extinction_per_m=0.06, frames=10)
    spots = instrument.tof.record(given, instrument.spot_optics, np.random.default_rng(0))
    solve = ranging_method("fog", spots).compile(between(spots, 0, 0))
    assert {solve(between(spots, n, n + 1)).status for n in range(10)} == {("ok",) * 4}


def test_models_are_as_probable_as_their_evidence_makes_them() -> None:
    assert probability_of_uneven(0.0) == pytest.approx(UNEVEN)
    assert probability_of_uneven(np.log(3)) == pytest.approx(3 * UNEVEN / (1 + 2 * UNEVEN))
    assert probability_of_uneven(-np.inf) < 1e-100
    assert probability_of_uneven(np.inf) == 1


def test_alternatives_of_two_models_are_mixed_by_their_probabilities() -> None:
    even = SpotPosterior((Alternative(3.0, 0.01, 1.0),), target=1.0, strength=30.0)
    own = SpotPosterior(
        (Alternative(5.0, 0.02, 0.75), Alternative(3.0, 0.01, 0.25)), target=0.8, strength=25.0
    )
    result = mixed(even, own, 0.25)
    assert result.target == pytest.approx(0.75 + 0.25 * 0.8)
    near, far = result.alternatives
    assert near.range_m == pytest.approx(3.0)
    assert far.weight == pytest.approx(0.25 * 0.8 * 0.75 / result.target)
    assert result.needed < mixed(even, own, 0.75).needed == STANDS_OUT


@pytest.mark.parametrize(("extinction_per_m", "contradicts"), [(0.0, False), (0.05, True)])
def test_fog_in_weather_that_is_stated_clear_is_named(extinction_per_m, contradicts) -> None:
    instrument = load_instrument("fog")
    given = light(instrument, [3.0, 4.5, 5.5, 7.0], extinction_per_m=extinction_per_m)
    spots = instrument.tof.record(given, instrument.spot_optics, np.random.default_rng(0))
    spots = replace(spots, **Weather.parsed("clear")._asdict())
    ranges = ranging_method("fog", spots).compile(between(spots, 0, 0))(spots)
    notes = range_consistency({"fog": ranges}, spots)
    assert ("fog" in notes) == contradicts
    assert not contradicts or "stated clear, but the readings hold the echo of fog" in notes["fog"]
