"""The converter's input: photo-electrons of any mean, from none to far beyond the full scale."""

import numpy as np
import pytest

from spisim.instrument import load_instrument
from spisim.measurement.electronics import LARGE_MEAN, read_out

DETECTOR = load_instrument("paper").detector


def counts(mean, frames=1, detector=DETECTOR):
    rng = np.random.default_rng(0)
    means = np.repeat(np.atleast_2d(np.asarray(mean, float)), frames, axis=0)
    return read_out(means, detector, 0.0, rng)


@pytest.mark.parametrize("mean", [1e13, 1e19, 1e30, 1e200])
def test_more_light_than_can_be_drawn_just_saturates(mean: float) -> None:
    readings = counts(mean)
    assert readings.saturated.all()
    assert (readings.counts == DETECTOR.adc.max_count).all()


def test_both_sides_of_the_limit_scatter_as_the_square_root() -> None:
    adc = DETECTOR.adc.model_copy(update={"bits": 31, "full_scale_electrons": 2.0**41})
    detector = DETECTOR.model_copy(update={"adc": adc})
    mean = LARGE_MEAN * np.array([0.999, 1.001])
    readings = counts(mean, 4000, detector)
    electrons = (readings.counts - adc.offset_counts) * adc.electrons_per_count
    z = (electrons.mean(axis=0) - mean) / np.sqrt(mean / 4000)
    assert np.abs(z).max() < 4
    ratio = electrons.var(axis=0, ddof=1) / mean
    assert np.abs(ratio - 1).max() < 4 * np.sqrt(2 / 3999)


def test_darkness_gives_the_offset() -> None:
    assert counts(0.0).counts.tolist() == [[DETECTOR.adc.offset_counts]]


def test_large_means_do_not_change_the_draw_of_the_others() -> None:
    alone, beside = counts([1e5, 2e5, 0]), counts([1e5, 2e5, 1e15])
    assert alone.counts[0, :2].tolist() == beside.counts[0, :2].tolist()
