"""Bins of path length: fine where a laser meets something, however far that is, and few."""

from functools import partial

import numpy as np
import pytest
from scipy.constants import c

from reconstruction.base.errors import InputError
from spisim.instrument import list_presets, load_instrument
from spisim.simulation.light.path_bins import (
    BIN_WIDTH_M,
    LONGEST_PATH_M,
    MIN_BIN_WIDTH_M,
    NEAR_PATH_M,
    bins_for,
    split_light,
    spot_bins,
)
from spisim.transport.backend import activate
from spisim.transport.engine.tally import Contribution, HistogramTally, PathLengthBins, Tallies

# isort: split
import mitsuba as mi

NO_RETURN = np.full(4, np.nan)


def histogram(bins: PathLengthBins, lengths_m: list[float]) -> np.ndarray:
    """Contributions of one at these path lengths."""
    activate()
    tallies = Tallies(1, [partial(HistogramTally, bins=bins)])
    lengths = mi.Float(np.array(lengths_m, np.float32))
    tallies.add(
        Contribution(mi.Float(1), mi.UInt32(0), lengths, mi.UInt32(0), mi.Bool(True), mi.UInt32(0))
    )
    return next(tallies.read(1.0).values)["histogram"][0]


@pytest.mark.parametrize("ranges_m", [NO_RETURN, np.array([3.0, np.nan, 34.0, 9.0])])
def test_of_what_is_near_they_are_even(ranges_m: np.ndarray) -> None:
    bins = spot_bins(ranges_m, 10.0)
    np.testing.assert_allclose(bins.centres_m, np.arange(4001) * BIN_WIDTH_M)


@pytest.mark.parametrize("range_m", [41.0, 300.0, 3000.0, 9900.0])
def test_of_what_is_far_they_are_fine_around_it_and_few(range_m: float) -> None:
    bins = spot_bins(np.array([5.0, np.nan, range_m, range_m]), 10.0)
    centres = bins.centres_m
    assert (np.diff(centres) > 0.9 * BIN_WIDTH_M).all()
    assert bins.count < 6000
    assert centres[-1] >= 2 * range_m
    around = (centres > max(2 * range_m - 5, NEAR_PATH_M)) & (centres < 2 * range_m + 5)
    np.testing.assert_allclose(np.diff(centres[around]), BIN_WIDTH_M, rtol=1e-6)
    np.testing.assert_allclose(centres / BIN_WIDTH_M, np.rint(centres / BIN_WIDTH_M), atol=1e-6)


def test_they_reach_as_far_as_the_instrument_tells_apart_and_no_farther_than_light_does() -> None:
    assert spot_bins(NO_RETURN, 500.0).centres_m[-1] >= 1000
    beyond = spot_bins(np.array([1e5, np.nan, np.nan, np.nan]), np.inf).centres_m
    assert beyond[-1] == pytest.approx(LONGEST_PATH_M, rel=0.01)
    assert beyond.size < 6000


def test_every_path_length_is_kept_by_its_mean() -> None:
    bins = spot_bins(np.array([5.0, 300.0, 3000.0, np.nan]), 10.0)
    for length_m in (0.013, 79.99, 80.0, 80.3, 123.4, 599.987, 604.0, 4000.0, 5999.5, 6000.011):
        light = histogram(bins, [length_m])
        assert light.sum() == pytest.approx(1)
        assert light @ bins.centres_m == pytest.approx(length_m, rel=2e-7, abs=2e-6)
        assert np.ptp(np.flatnonzero(light)) <= 1
    late = histogram(bins, [7000.0, 1e6])
    assert late[-1] == pytest.approx(2)


def test_nothing_is_lost_among_far_bins() -> None:
    bins = PathLengthBins(4, 0.5, (5.0, 20.0))
    np.testing.assert_allclose(bins.centres_m, [0, 0.5, 1, 1.5, 5, 20])
    np.testing.assert_allclose(histogram(bins, [1.5, 3.25, 20.0, 99.0]), [0, 0, 0, 1.5, 0.5, 2])


def test_they_are_as_narrow_as_the_shortest_edge_asks_for() -> None:
    """As far as the instrument tells paths apart; 2 cm beyond, and never wider."""
    fine = spot_bins(NO_RETURN, 1.8, 0.0031).centres_m
    within = fine < 3.6
    assert np.diff(fine[within]) == pytest.approx(BIN_WIDTH_M / 7)
    np.testing.assert_allclose(np.diff(fine[fine > 4.0]), BIN_WIDTH_M, rtol=1e-6)
    assert fine[-1] == pytest.approx(NEAR_PATH_M)
    np.testing.assert_allclose(spot_bins(NO_RETURN, 1.8, 5.0).centres_m, np.arange(4001) * 0.02)


def test_they_are_narrow_about_far_surfaces_that_are_told_apart() -> None:
    near, far = (spot_bins(np.full(4, 100.0), most_m, 0.005).centres_m for most_m in (50.0, 150.0))
    for centres, width_m in ((near, BIN_WIDTH_M), (far, 0.005)):
        around = (centres > 195) & (centres < 205)
        np.testing.assert_allclose(np.diff(centres[around]), width_m, rtol=1e-6)


@pytest.mark.parametrize("name", list_presets())
def test_edges_of_every_preset_have_ten_of_them(name: str) -> None:
    instrument = load_instrument(name)
    if not instrument.ranges:
        return
    tof = instrument.ranging.tof
    width_m = np.diff(bins_for(tof, NO_RETURN).centres_m[:2])
    assert width_m <= c * tof.edge_s / 10 * (1 + 1e-9)
    tof.check_bins(MIN_BIN_WIDTH_M)


def test_light_is_split_as_transport_splits_it() -> None:
    bins = spot_bins(np.array([5.0, 300.0, 3000.0, np.nan]), 10.0)
    for length_m in (0.013, 79.99, 123.4, 604.0, 7000.0):
        ours = split_light(np.array([length_m]), np.ones(1), bins.centres_m)
        np.testing.assert_allclose(ours, histogram(bins, [length_m]), atol=1e-2)
        assert ours.sum() == pytest.approx(1)


def test_a_pulse_too_short_for_the_narrowest_is_refused() -> None:
    tof = load_instrument("spad").tof.model_copy(update={"pulse_fwhm_s": 1e-11})
    with pytest.raises(InputError, match=r"tof\.pulse_fwhm_s 1e-11: .*at least 4\.7\d+e-11"):
        tof.check_bins(MIN_BIN_WIDTH_M)
    tof.model_copy(update={"pulse_fwhm_s": 4.8e-11}).check_bins(MIN_BIN_WIDTH_M)
