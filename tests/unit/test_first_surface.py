"""The posterior of first surfaces: nothing that is not excluded is dropped on the way."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.ranging import Alternative, Ranges
from reconstruction.ranging.brightness import Brightness
from reconstruction.ranging.first_surface import EDGES_M, SATURATING_M, first_surfaces
from reconstruction.ranging.image_level import ImageLevel

NAN = np.nan
MIDDLES_M = np.append(EDGES_M / np.sqrt(EDGES_M[1] / EDGES_M[0]), np.inf)


def ranges(status, alternatives=(), nothing=None, range_m=NAN, spots=1):
    """Ranges of some equal spots."""
    return Ranges(
        range_m=np.full(spots, range_m),
        sigma_m=np.full(spots, 0.01 if np.isfinite(range_m) else NAN),
        signal_electrons=np.ones(spots),
        background_electrons=np.ones(spots),
        status=(status,) * spots,
        alternatives=(tuple(alternatives),) * spots,
        nothing=np.full(spots, NAN if nothing is None else nothing),
    )


def beyond(ranges, at_m, blind_m=0.0, **others):
    """Probability that the first surface of the first spot is beyond a range."""
    surfaces = first_surfaces(ranges, np.full(len(ranges.status), blind_m), **others)
    np.testing.assert_allclose(surfaces.mass.sum(axis=1), 1)
    return float(np.interp(at_m, EDGES_M, surfaces.beyond[0]))


def test_every_alternative_keeps_its_weight():
    both = ranges("ambiguous", [Alternative(12.0, 0.02, 0.8), Alternative(2.0, 0.02, 0.2)], 0.0)
    assert beyond(both, 1.5) == pytest.approx(1.0, abs=1e-6)
    assert beyond(both, 3.0) == pytest.approx(0.8, abs=1e-6)
    assert beyond(both, 14.0) == pytest.approx(0.0, abs=1e-3)


def test_simultaneous_echoes_are_all_surfaces():
    echoes = [Alternative(6.0, 0.02, 0.9), Alternative(2.0, 0.02, 0.1)]
    assert beyond(ranges("ok", echoes, 0.0, 6.0), 3.0) < 1e-6


def test_a_saturated_spot_is_something_near():
    assert beyond(ranges("saturated"), SATURATING_M) == pytest.approx(0, abs=0.02)


@pytest.mark.parametrize("status", ["no signal", "weak"])
def test_where_nothing_at_all_returns_the_lens_may_be_covered(status):
    alternatives = [Alternative(9.0, 0.1, 1.0)] if status == "weak" else []
    assert beyond(ranges(status, alternatives, spots=4), 1.0) <= 0.5


def test_a_lost_spot_among_others_is_no_covered_lens():
    one = ranges("no signal", spots=2)
    mixed = Ranges(
        range_m=np.array([NAN, 5.0]),
        sigma_m=np.array([NAN, 0.01]),
        signal_electrons=one.signal_electrons,
        background_electrons=one.background_electrons,
        status=("no signal", "ok"),
    )
    assert beyond(mixed, 1.0) > 0.9


def test_a_target_that_noise_explains_too_uncovers_no_lens():
    """One spot of four has a target with a probability of 0.75, by noise: the others do not."""
    lost = ranges("fog", [Alternative(8.0, 0.1, 1.0)], spots=4)
    uncertain, sure = (
        replace(lost, nothing=np.array([0.7, 0.75, nothing, 0.9])) for nothing in (0.25, 0.01)
    )
    assert beyond(uncertain, 1.0) < 0.7
    assert beyond(sure, 1.0) > 0.9


def test_what_lies_in_the_blind_zone_is_not_excluded():
    lost = ranges("fog", [Alternative(9.0, 0.1, 1.0)], nothing=0.95, spots=4)
    blind, seeing = (
        beyond(lost, 0.2, blind_m=blind_m) - beyond(lost, 1.4, blind_m=blind_m)
        for blind_m in (1.4, 0.2)
    )
    assert blind > 5 * seeing


def test_quantiles_follow_the_weights():
    both = ranges("ambiguous", [Alternative(12.0, 0.02, 0.8), Alternative(2.0, 0.02, 0.2)], 0.0)
    surfaces = first_surfaces(both, np.zeros(1))
    near_m, far_m = surfaces.quantiles_m(np.array([0.1, 0.5]))[:, 0]
    assert near_m == pytest.approx(2.0, rel=0.1)
    assert far_m == pytest.approx(12.0, rel=0.1)


def level(fog=0.0):
    """Image of a camera that gets 1000 electrons of a white surface at 1 m."""
    white = np.append(1000 / MIDDLES_M[:-1] ** 2, 0.0)
    return ImageLevel(white[None], fog)


def test_a_bright_pixel_is_near_wherever_lasers_are_blind():
    bright = level().likelihood(Brightness(np.array([10_000.0]), np.array([10.0])))
    lost = ranges("weak", [Alternative(9.0, 0.1, 1.0)], spots=1)
    assert beyond(lost, 1.0, blind_m=0.3, image=bright) < 0.2
    assert beyond(lost, 1.0, blind_m=0.3) > 0.3


@pytest.mark.parametrize("distance_m", [0.5, 1.0, 3.0])
def test_the_likeliest_range_of_a_brightness_is_that_of_typical_reflectance(distance_m):
    electrons = 0.27 * 1000 / distance_m**2
    likelihood = level().likelihood(Brightness(np.array([electrons]), np.array([1.0])))[0]
    assert MIDDLES_M[likelihood.argmax()] == pytest.approx(distance_m, rel=0.6)


def test_an_unknown_pixel_says_nothing():
    unknown = level().likelihood(Brightness(np.array([NAN]), np.array([NAN])))
    np.testing.assert_array_equal(unknown, 1.0)


@pytest.mark.parametrize(
    "alternatives",
    [[Alternative(NAN, NAN, 1.0)], [Alternative(5.0, 0.1, 0.0)], [Alternative(-1.0, 0.1, 1.0)]],
)
def test_unusable_alternatives_are_no_free_way(alternatives):
    assert beyond(ranges("ambiguous", alternatives, 0.0, spots=4), 4.0) < 0.9


def test_one_unusable_alternative_drops_no_other():
    mixed = [Alternative(2.0, 0.02, 0.5), Alternative(NAN, NAN, 0.5)]
    assert beyond(ranges("ambiguous", mixed, 0.0), 3.0) == pytest.approx(0, abs=1e-6)
