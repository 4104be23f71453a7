"""Whether two captures can be compared: the same patterns, spots and kinds of readings."""

import numpy as np

from reconstruction.base.errors import InputError
from reconstruction.capture import Capture, Spots
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.operators import PatternPlan

SAME_DIRECTION = 1e-3
"""Maximum difference of the components of directions that count as the same."""
SAME_TIMING = 1e-3
"""Maximum relative difference of frequencies, times and exposures that count as the same."""


def check_comparable(real: Capture, simulated: Capture) -> None:
    """Raise InputError, which names the difference, unless two captures can be compared."""
    _check_plans(real, simulated)
    for name, capture in (("REAL", real), ("SIMULATED", simulated)):
        _check_still(name, capture)
    units = real.buckets.unit, simulated.buckets.unit
    if real.plan.shows_image and units[0] != units[1]:
        unknown = "REAL" if units[0] == "count" else "SIMULATED"
        raise InputError(
            f"{unknown}: buckets/electrons_per_count is unknown (nan), so that its readings cannot "
            "be compared with electrons: state it when importing"
        )
    _same_number(
        "buckets/exposure_time_s", real.buckets.exposure_time_s, simulated.buckets.exposure_time_s
    )
    _check_spots(real.spots, simulated.spots)


def _check_plans(real: Capture, simulated: Capture) -> None:
    plans, others = real.setup.plans, simulated.setup.plans
    if len(plans) != len(others):
        raise InputError(
            f"patterns: REAL has {len(plans)} plans that alternate from frame to frame, SIMULATED "
            f"{len(others)}; record the same plan"
        )
    for turn, (one, other) in enumerate(zip(plans, others, strict=True)):
        different = _difference_of_plans(one, other)
        if different:
            where = f" of plan {turn}" if len(plans) > 1 else ""
            raise InputError(f"patterns{where}: {different}; record the same plan")


def _difference_of_plans(one: PatternPlan, other: PatternPlan) -> str:
    """What differs first, in words; empty if nothing does."""
    for what, values in (
        ("shape", (one.shape, other.shape)),
        ("basis", (one.basis, other.basis)),
        ("number of exposures", (one.exposures, other.exposures)),
    ):
        if values[0] != values[1]:
            return f"{what} is {values[0]} in REAL, {values[1]} in SIMULATED"
    for what, arrays in (
        ("index", (one.index, other.index)),
        ("polarity", (one.polarity, other.polarity)),
    ):
        unequal = np.flatnonzero(arrays[0] != arrays[1])
        if unequal.size:
            k = int(unequal[0])
            return (
                f"{what} of exposure {k} is {arrays[0][k]} in REAL, {arrays[1][k]} in SIMULATED "
                f"({unequal.size} of {arrays[0].size} differ)"
            )
    for name in one.patterns.arrays:
        if not np.array_equal(getattr(one.patterns, name), getattr(other.patterns, name)):
            return f"the {name} of the basis {one.basis} differ"
    return ""


def _check_still(name: str, capture: Capture) -> None:
    if capture.poses is not None:
        raise InputError(f"{name}: a flight with poses; compare recordings of a drone at rest")
    if capture.spots is not None and capture.spots.pointing is not None:
        raise InputError(f"{name}: spots/pointing: steered spots cannot be compared")


def _same_number(what: str, one: float, other: float) -> None:
    if np.isfinite([one, other]).all() and abs(one - other) > SAME_TIMING * abs(other):
        raise InputError(f"{what} is {one:g} in REAL, {other:g} in SIMULATED; must be the same")


def _check_spots(one: Spots | None, other: Spots | None) -> None:
    if (one is None) != (other is None):
        without = "REAL" if one is None else "SIMULATED"
        raise InputError(f"{without} has no spots, the other capture has; both must have the same")
    if one is None or other is None:
        return
    for what, values in (
        ("method", (one.method, other.method)),
        ("number of spots", (len(one.directions), len(other.directions))),
        ("number of readings of a spot", (one.readings.shape[-1], other.readings.shape[-1])),
    ):
        if values[0] != values[1]:
            raise InputError(f"spots: {what} is {values[0]} in REAL, {values[1]} in SIMULATED")
    _check_directions(one, other)
    for name in _TIMING[one.method]:
        pair = zip(np.ravel(getattr(one, name)), np.ravel(getattr(other, name)), strict=True)
        for one_value, other_value in pair:
            _same_number(f"spots/{name}", float(one_value), float(other_value))


_TIMING = {
    CwSpots.method: ("tap_frequencies_hz", "tap_phases_rad"),
    PulsedSpots.method: ("window_starts_s", "pulse_width_s"),
    HistogramSpots.method: ("bin_width_s", "start_s"),
}
"""Fields that must be the same, by method."""


def _check_directions(one: Spots, other: Spots) -> None:
    apart = np.abs(one.directions - other.directions).max(axis=1)
    spot = int(apart.argmax())
    if apart[spot] > SAME_DIRECTION:
        given = [np.round(each.directions[spot], 4).tolist() for each in (one, other)]
        raise InputError(
            f"spots/directions: spot {spot} is {given[0]} in REAL, {given[1]} in SIMULATED"
        )
