"""Ranges in words, where a number does not tell enough."""

from collections.abc import Iterable

from ..ranging import Alternative, Status

SHOWN = 3
"""Alternatives that are told at most."""
LEAST = 0.01
"""Those with less weight are not."""


def no_range(status: Status, alternatives: Iterable[Alternative]) -> str:
    """Why a spot has no range, and which ranges it may have, likeliest first."""
    told = [each for each in alternatives if each.weight >= LEAST][:SHOWN]
    if not told:
        return status
    if len(told) == 1:
        return f"{status}: {told[0].range_m:.2f} ± {told[0].sigma_m:.2f} m"
    ranges = (f"{each.range_m:.2f} m ({100 * each.weight:.0f} %)" for each in told)
    return f"{status}: {', '.join(ranges)}"
