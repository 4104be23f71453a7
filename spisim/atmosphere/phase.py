"""Phase functions: how much light a medium scatters into which direction.

A phase function gives the density, per steradian, of the cosine between the directions of travel
before and after; it integrates to 1 over the sphere, and cos = +1 is straight on. Its mean cosine
is the asymmetry g.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError

#: A table whose asymmetry is further than this from the declared one is too coarse.
G_TOLERANCE = 0.002
#: Weights of a blend may miss 1 by what rounding to a few digits costs, and are then scaled.
WEIGHT_TOLERANCE = 1e-3


@dataclass(frozen=True)
class Isotropic:
    """The same into every direction."""

    @property
    def g(self) -> float:
        """Mean cosine of the scattering angle."""
        return 0.0

    def density(self, cos: ArrayLike) -> Floats:
        """Density at each cosine, 1/sr."""
        return np.full_like(np.asarray(cos, float), 1 / (4 * np.pi))


@dataclass(frozen=True)
class HenyeyGreenstein:
    """One smooth lobe of mean cosine `g` (Henyey & Greenstein 1941).

    For water fog that gives the right width of the forward lobe but underestimates scattering
    straight back (180°) 6 to 16 times against Mie theory, and with it the fog's own echo in bucket
    and time of flight. Raises InputError unless -1 < g < 1.
    """

    g: float

    def __post_init__(self) -> None:
        if not -1 < self.g < 1:
            raise InputError(f"g should lie between -1 and 1, both excluded; found {self.g}")

    def density(self, cos: ArrayLike) -> Floats:
        """Density at each cosine, 1/sr."""
        g = self.g
        return (1 - g**2) / (4 * np.pi * (1 + g**2 - 2 * g * np.asarray(cos, float)) ** 1.5)


@dataclass(frozen=True, eq=False)
class Tabulated:
    """A table on a uniform grid of the cosine from -1 to +1, linear between its nodes.

    The scale of `values` is free: the table is normalised as it is interpolated, which is how
    Mitsuba's `tabphase` reads it. `declared_g` is the asymmetry that the table should have; a grid
    too coarse for a narrow forward lobe shows in it. `name` is what messages call the table.

    Raises InputError for fewer than two values, values that are negative, not finite or all zero,
    and a table whose asymmetry is not the declared one.
    """

    values: Floats  # (nodes,)
    declared_g: float | None = None
    name: str = "table"

    def __post_init__(self) -> None:
        values = np.array(self.values, dtype=np.float64)  # a copy that nobody else can change
        if values.ndim != 1 or values.size < 2:
            raise InputError(
                f"phase function {self.name!r} should be a list of 2 or more values; "
                f"found shape {values.shape}"
            )
        if not np.isfinite(values).all() or (values < 0).any() or not values.any():
            raise InputError(
                f"phase function {self.name!r} should have finite values of 0 or more, not all 0"
            )
        values.setflags(write=False)
        object.__setattr__(self, "values", values)
        if self.declared_g is not None and not abs(self.g - self.declared_g) <= G_TOLERANCE:
            raise InputError(
                f"phase function {self.name!r}: its {values.size} nodes, uniform in the cosine, "
                f"give g = {self.g:.4f} instead of {self.declared_g:.4f}: the table is too coarse"
            )

    @property
    def g(self) -> float:
        """Mean cosine of the scattering angle, of the table as interpolated."""
        mu, values = self._cosines(), self.values
        left, right = values[:-1], values[1:]
        first_moment = (mu[:-1] * (2 * left + right) + mu[1:] * (left + 2 * right)) / 3
        return float(first_moment.sum() / (left + right).sum())

    def density(self, cos: ArrayLike) -> Floats:
        """Density at each cosine, 1/sr."""
        step = 2 / (self.values.size - 1)
        integral = 2 * np.pi * step * (self.values.sum() - (self.values[0] + self.values[-1]) / 2)
        return np.asarray(
            np.interp(np.asarray(cos, float), self._cosines(), self.values / integral)
        )

    def _cosines(self) -> Floats:
        return np.linspace(-1, 1, self.values.size)


@dataclass(frozen=True)
class Blend:
    """A mixture of phase functions, as (weight, phase function).

    Raises InputError unless there is a part, every weight is above 0, and they sum to 1.
    """

    parts: tuple[tuple[float, Phase], ...]

    def __post_init__(self) -> None:
        weights = [weight for weight, _ in self.parts]
        total = math.fsum(weights)
        if not all(weight > 0 for weight in weights) or not abs(total - 1) <= WEIGHT_TOLERANCE:
            raise InputError(
                f"weights of a blend should be greater than 0 and sum to 1; found {weights}"
            )
        scaled = tuple((weight / total, phase) for weight, phase in self.parts)
        object.__setattr__(self, "parts", scaled)

    @property
    def g(self) -> float:
        """Mean cosine of the scattering angle."""
        return math.fsum(weight * phase.g for weight, phase in self.parts)

    def density(self, cos: ArrayLike) -> Floats:
        """Density at each cosine, 1/sr."""
        cos = np.asarray(cos, float)
        return np.sum([weight * phase.density(cos) for weight, phase in self.parts], axis=0)


Phase: TypeAlias = HenyeyGreenstein | Isotropic | Tabulated | Blend


def henyey_greenstein(g: float) -> HenyeyGreenstein | Isotropic:
    """Henyey-Greenstein phase function, which is the isotropic one for g = 0.

    Raises InputError unless -1 < g < 1.
    """
    return Isotropic() if g == 0 else HenyeyGreenstein(g)
