"""Numbers with engineering prefixes of their units."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter

PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
#: Units with prefixes; numbers in other units or none take powers of ten.
PREFIXED = frozenset({"m", "s", "W", "Hz", "W/m", "e⁻"})
#: Range in which numbers without prefix have no power of ten.
PLAIN_FROM, PLAIN_TO = 0.01, 1e4


@dataclass(frozen=True)
class Prefix:
    """The divisor of values, and the resulting unit."""

    factor: float
    unit: str

    @classmethod
    def of(cls, values: Iterable[float], unit: str) -> "Prefix":
        """Choose the prefix that suits the largest of some values."""
        largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
        exponent = 3 * math.floor(math.log10(largest * (1 + 1e-9)) / 3) if largest > 0 else 0
        exponent = min(max(exponent, min(PREFIXES)), max(PREFIXES))
        if unit in PREFIXED:
            return cls(10.0**exponent, PREFIXES[exponent] + unit)
        if largest == 0 or PLAIN_FROM <= largest < PLAIN_TO:
            return cls(1.0, unit)
        return cls(10.0**exponent, f"× 10{_raised(exponent)} {unit}".strip())

    def write(self, value: float) -> str:
        """Format the number alone, with enough digits for a scale."""
        return f"{value / self.factor:,.4g}".replace("e+0", "e").replace("-", "−")


def engineering(value: float | None, unit: str, digits: int = 3) -> str:
    """Format a value with its unit, as "7.26 µW"; a dash for None."""
    if value is None or not math.isfinite(value):
        return "–"
    rounded = float(f"{value:.{digits}g}")
    prefix = Prefix.of([rounded], unit)
    number = rounded / prefix.factor
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(number)))) if number else 0
    return f"{number:,.{decimals}f} {prefix.unit}".strip().replace("-", "−")


def prefix_axis(axis: Axis, label: str) -> None:
    """Label an axis with a suitable prefix; its label must end in a unit, as "error, m".

    The limits of the axis must be final.
    """
    name, _, unit = label.rpartition(", ")
    if unit not in PREFIXED:
        axis.set_label_text(label)
        return
    prefix = Prefix.of(axis.get_view_interval(), unit)
    axis.set_label_text(f"{name}, {prefix.unit}")
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / prefix.factor:g}"))


def prefix_log(axis: Axis, unit: str = "") -> None:
    """Label decades of a logarithmic axis each with its own prefix, as "10 µW/m"."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: engineering(value, unit, 1)))


def _raised(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
