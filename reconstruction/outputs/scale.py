"""Colour scales and their numbers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GREY = ("000000", "ffffff")
VIRIDIS = (
    *("fde724", "d4e11a", "aadb32", "81d34c", "5bc862", "3dbb74"),
    *("27ad80", "1e9e88", "208f8c", "26808e", "2c718e", "33618d"),
    *("3b518a", "423e85", "472b7a", "471669", "440154"),
)
"""Yellow is near, violet far; S. van der Walt, N. Smith, public domain, 17 equal steps."""
STEPS = (1, 2, 2.5, 5, 10, 20)
"""Round steps of a scale, in powers of ten."""
EXPONENTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Scale:
    """Scale from ``low`` to ``high`` with ``colours`` at equal steps, as hexadecimal RGB."""

    low: float
    high: float
    colours: tuple[str, ...]

    def paint(self, values: NDArray[np.floating]) -> NDArray[np.uint8]:
        """Colours (..., 3) of finite values (...), clipped to the scale."""
        table = np.array([list(bytes.fromhex(colour)) for colour in self.colours], np.float64)
        fraction = (np.asarray(values, np.float64) - self.low) / (self.high - self.low)
        at = np.clip(fraction, 0, 1) * (len(table) - 1)
        painted = [np.interp(at, np.arange(len(table)), channel) for channel in table.T]
        return np.stack(painted, axis=-1).round().astype(np.uint8)

    def numbers(self, maximum: int) -> tuple[list[float], list[str], str]:
        """Up to ``maximum`` round numbers: values, texts, and their common factor."""
        exponent = self._exponent
        low, high = self.low / 10.0**exponent, self.high / 10.0**exponent
        step = _step(low, high, maximum)
        digits = next(n for n in range(20) if abs(round(step, n) - step) < 1e-9 * step)
        ticks = step * np.arange(*_multiples(low, high, step))
        factor = f"×10{str(exponent).translate(EXPONENTS)}" if exponent else ""
        return list(ticks * 10.0**exponent), [f"{tick + 0.0:.{digits}f}" for tick in ticks], factor

    @property
    def _exponent(self) -> int:
        """Power of ten of the common factor, 0 for handy numbers."""
        largest = max(abs(self.low), abs(self.high))
        power = int(np.floor(np.log10(largest))) if largest > 0 else 0
        return 0 if -3 <= power < 5 else power


def _step(low: float, high: float, maximum: int) -> float:
    """Minimum round step with at most so many multiples between two numbers."""
    power = 10.0 ** np.floor(np.log10((high - low) / maximum))
    return next(
        step
        for step in (fraction * power for fraction in STEPS)
        if np.diff(_multiples(low, high, step)) <= maximum
    )


def _multiples(low: float, high: float, step: float) -> tuple[float, float]:
    """First multiple of a step between two numbers, and the one after the last."""
    return float(np.ceil(low / step - 1e-9)), float(np.floor(high / step + 1e-9) + 1)
