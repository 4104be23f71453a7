"""Numbers in the prefix of their unit that suits them, as engineers write them."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter

PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
#: Units that take prefixes; numbers of others, and of none, take powers of ten.
PREFIXED = frozenset({"m", "s", "W", "Hz", "W/m", "e⁻"})
#: Between these, numbers that take no prefix are written as they are.
PLAIN_FROM, PLAIN_TO = 0.01, 1e4


@dataclass(frozen=True)
class Prefix:
    """What values are divided by, and the unit that they then have."""

    factor: float
    unit: str

    @classmethod
    def of(cls, values: Iterable[float], unit: str) -> "Prefix":
        """The one that suits the largest of some values in a unit."""
        largest = max((abs(value) for value in values if math.isfinite(value)), default=0.0)
        exponent = 3 * math.floor(math.log10(largest * (1 + 1e-9)) / 3) if largest > 0 else 0
        exponent = min(max(exponent, min(PREFIXES)), max(PREFIXES))
        if unit in PREFIXED:
            return cls(10.0**exponent, PREFIXES[exponent] + unit)
        if largest == 0 or PLAIN_FROM <= largest < PLAIN_TO:
            return cls(1.0, unit)
        return cls(10.0**exponent, f"× 10{_raised(exponent)} {unit}".strip())

    def write(self, value: float) -> str:
        """The number alone, with so many digits that it can be read back from a scale."""
        return f"{value / self.factor:,.4g}".replace("e+0", "e").replace("-", "−")


def engineering(value: float | None, unit: str, digits: int = 3) -> str:
    """A value with its unit, as "7.26 µW"; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    rounded = float(f"{value:.{digits}g}")
    prefix = Prefix.of([rounded], unit)
    number = rounded / prefix.factor
    positions = max(0, digits - 1 - math.floor(math.log10(abs(number)))) if number else 0
    return f"{number:,.{positions}f} {prefix.unit}".strip().replace("-", "−")


def prefix_axis(axis: Axis, label: str) -> None:
    """Write an axis of which the label ends in a unit, as "error, m", in the unit that suits it.

    After its limits are known.
    """
    name, _, unit = label.rpartition(", ")
    if unit not in PREFIXED:
        axis.set_label_text(label)
        return
    prefix = Prefix.of(axis.get_view_interval(), unit)
    axis.set_label_text(f"{name}, {prefix.unit}")
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / prefix.factor:g}"))


def prefix_log(axis: Axis, unit: str = "") -> None:
    """Write decades of a logarithmic axis each with its own prefix, as "10 µW/m"."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: engineering(value, unit, 1)))


def _raised(exponent: int) -> str:
    return str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
