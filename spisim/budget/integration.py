"""The paper's search for the integration time (its section 2, steps 1 to 5)."""

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.budget.equations import Flood, eq2

#: What equals the noise floor at maximum range: the signal, which is physical, or all of Eq. (1),
#: in which daylight counts as signal, as in the paper's step 4.
Criterion = Literal["signal", "total"]

FIRST_TIME_S, LAST_TIME_S = 1e-12, 1e3
RELATIVE_TOLERANCE = 1e-6
#: Times tried for several goals together.
TIMES = 4001


def max_range_m(
    flood: Flood, time_s: ArrayLike, reflectance: ArrayLike, criterion: Criterion
) -> Floats:
    """Step 4: distance where the count equals Eq. (2); inf if daylight alone exceeds it."""
    brightness = np.asarray(reflectance, dtype=np.float64)
    needed = eq2(flood, time_s, brightness) / np.asarray(time_s)
    if criterion == "total":
        needed = needed - brightness * flood.background_per_s
    with np.errstate(divide="ignore"):
        squared = brightness * flood.signal_per_s / np.maximum(needed, 0)
    return np.sqrt(squared)


def integration_time_s(
    flood: Flood, reflectance: float, goal_m: float, criterion: Criterion
) -> float:
    """Step 5: time at which the maximum range meets the goal; InputError beyond 1000 s."""

    def enough(time_s: float) -> bool:
        return bool(max_range_m(flood, time_s, reflectance, criterion) >= goal_m)

    low = high = FIRST_TIME_S
    while not enough(high):
        low, high = high, 2 * high
        if high > LAST_TIME_S:
            raise InputError(
                f"no integration time up to {LAST_TIME_S:g} s brings the light of "
                f"{flood.power_w:g} W to {goal_m:g} m"
            )
    while high > low * (1 + RELATIVE_TOLERANCE):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def common_integration_time_s(
    flood: Flood, goals_m: Mapping[float, float], criterion: Criterion
) -> float:
    """The time whose maximum ranges fit the goals by reflectance best, in least squares of logs."""
    alone = [integration_time_s(flood, rho, goal, criterion) for rho, goal in goals_m.items()]
    times = np.geomspace(min(alone), max(alone), TIMES)
    goals = np.array(list(goals_m.values()))
    ranges_m = max_range_m(flood, times[:, None], np.array(list(goals_m)), criterion)
    misfit = np.sum(np.log(ranges_m / goals) ** 2, axis=-1)
    return float(times[np.argmin(misfit)])
