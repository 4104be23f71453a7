"""Ranges in words, where a number does not tell enough."""

from collections.abc import Iterable

from ..ranging import Alternative, Status

DISPLAYED = 3
"""Alternatives that are told at most."""
MIN = 0.01
"""Those with less weight are not."""


def no_range(status: Status, alternatives: Iterable[Alternative]) -> str:
    """Why a spot has no range, and which ranges it may have, likeliest first."""
    reported = [each for each in alternatives if each.weight >= MIN][:DISPLAYED]
    if not reported:
        return status
    if len(reported) == 1:
        return f"{status}: {reported[0].range_m:.2f} ± {reported[0].sigma_m:.2f} m"
    ranges = (f"{each.range_m:.2f} m ({100 * each.weight:.0f} %)" for each in reported)
    return f"{status}: {', '.join(ranges)}"
