"""How hard it may rain and snow."""

from collections.abc import Mapping
from types import MappingProxyType

from reconstruction.base.errors import InputError

#: mm/h of water. Heavier rain is not known to last for minutes.
HEAVIEST_MM_PER_H: Mapping[str, float] = MappingProxyType({"rain": 300.0, "snow": 20.0})


def check_rate(kind: str, rate_mm_per_h: float) -> None:
    """InputError for a rate of "rain" or "snow" that is not above 0 or more than the heaviest."""
    heaviest = HEAVIEST_MM_PER_H[kind]
    if not 0 < rate_mm_per_h <= heaviest:
        raise InputError(
            f"rate_mm_per_h of {kind} should be greater than 0 and at most {heaviest:g}; found "
            f"{rate_mm_per_h:g}"
        )
