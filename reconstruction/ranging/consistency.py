"""Consistency check of ranges that may be biased by fog or further echoes."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..base.arrays import Floats
from ..base.constants import c
from ..capture import Spots
from ..capture.readings.cw import CwSpots
from .methods.cw import demodulate, quadrature_weights
from .ranges import MIN_SIGNAL, Ranges

MIN_DIFFERENCE_M = 0.05
"""Smaller range differences may come from calibration."""
MAX_CLEAR_BACKSCATTER = 4e-4
"""Backscattering in 1 / (m sr) beyond which air is not clear: of 400 m of visibility."""
LISTED = 4
"""Maximum number of spots that a warning lists."""


def range_consistency(rangings: Mapping[str, Ranges], spots: Spots) -> dict[str, str]:
    """Warn, by method, about ranges that may be biased by fog or further echoes.

    Checks methods that assume a single echo. Their ranges are doubtful if a method that models
    other light disagrees, or if the ranges of single frequencies disagree, by more than MIN_SIGNAL
    standard deviations and MIN_DIFFERENCE_M. A single frequency alone shows nothing. Also warns of
    fog in weather that is stated clear.
    """
    result = {}
    for name, ranges in rangings.items():
        fog = ranges.fog
        if (
            spots.clear_probability == 1
            and fog is not None
            and fog.backscatter_per_m_sr > MAX_CLEAR_BACKSCATTER
        ):
            result[name] = (
                "the weather is stated clear, but the readings hold the echo of fog "
                f"(backscattering {fog.backscatter_per_m_sr:.2g} per metre and steradian)"
            )
        if _models_other_light(ranges):
            continue
        others = {other: each for other, each in rangings.items() if _models_other_light(each)}
        count = len(ranges.status)
        apart = _by_frequency(spots, ranges) if isinstance(spots, CwSpots) else [""] * count
        reasons = [_by_others(spot, ranges, others) or apart[spot] for spot in range(count)]
        affected = [f"{spot} ({why})" for spot, why in enumerate(reasons) if why]
        if more := affected[LISTED:]:
            affected[LISTED:] = [f"and {len(more)} more"]
        if affected:
            result[name] = (
                "possibly biased by fog or further echoes, beyond its sigma, at "
                f"spot{'s' * (len(affected) > 1)} {', '.join(affected)}"
            )
    return result


def _models_other_light(ranges: Ranges) -> bool:
    return ranges.fog is not None or any(ranges.alternatives)


def _by_others(spot: int, ranges: Ranges, others: Mapping[str, Ranges]) -> str:
    """Range of a spot by a method that models other light, empty if it agrees."""
    for name, other in others.items():
        if ranges.valid[spot] and other.valid[spot]:
            sigma_m = np.hypot(ranges.sigma_m[spot], other.sigma_m[spot])
            if abs(ranges.range_m[spot] - other.range_m[spot]) > _min_difference_m(sigma_m):
                return f"{other.range_m[spot]:.2f} m by {name}"
    return ""


def _by_frequency(spots: CwSpots, ranges: Ranges) -> Sequence[str]:
    """Ranges of each spot by single frequencies, empty if they agree."""
    frequencies = np.unique(spots.tap_frequencies_hz)
    if frequencies.size < 2:
        return [""] * len(ranges.status)
    electrons = spots.electrons(spots.taps[0])
    variance = spots.variance(electrons)
    tap_phases = spots.phases_rad
    ends = ranges.range_m[:, None] * spots.directions - spots.detector_positions_m
    paths_m = ranges.range_m + np.linalg.norm(ends, axis=1)
    off_m, sigma_m = [], []
    for frequency in frequencies:
        of = spots.tap_frequencies_hz == frequency
        inverse = quadrature_weights(tap_phases[of])
        phase, _, _, sigma = demodulate(electrons[:, of], variance[:, of], inverse)
        range_per_radian = c / (4 * np.pi * frequency)
        off = phase - 2 * np.pi * frequency / c * paths_m
        off_m.append((np.mod(off + np.pi, 2 * np.pi) - np.pi) * range_per_radian)
        sigma_m.append(sigma * range_per_radian)
    return [
        _apart(range_m, off, sigma) if status == "ok" else ""
        for range_m, status, off, sigma in zip(
            ranges.range_m, ranges.status, np.transpose(off_m), np.transpose(sigma_m), strict=True
        )
    ]


def _apart(range_m: float, off_m: Floats, sigma_m: Floats) -> str:
    """Minimum and maximum range of the frequencies (J,), if they differ."""
    near, far = int(off_m.argmin()), int(off_m.argmax())
    if not off_m[far] - off_m[near] > _min_difference_m(np.hypot(sigma_m[near], sigma_m[far])):
        return ""
    return f"{range_m + off_m[near]:.2f} to {range_m + off_m[far]:.2f} m by its frequencies"


def _min_difference_m(sigma_m: float) -> float:
    return max(MIN_SIGNAL * sigma_m, MIN_DIFFERENCE_M)
