"""Fisher information of parameters: bounds, and what readings do not determine.

For readings of the covariance C and the Jacobian J the information of the means is J^T C^-1 J; its
inverse bounds the covariance of every unbiased estimate (Cramer-Rao: S. M. Kay, Fundamentals of
Statistical Signal Processing I, eq. 3.31). That of the variances, which depend on the parameters,
too, is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_inverse.fit.parameters import Parameter

MAX_CONDITION = 1e8
"""Maximum condition number of the information, of parameters in units of their own bounds."""
MAX_SIGMA = 5.0
"""Minimum information: a logarithm is known to this, alone."""
MIN_PART = 0.2
"""Minimum part, of the largest, of a parameter that is named in a combination."""


@dataclass(frozen=True, eq=False)
class Information:
    """Fisher information (k, k) of the coordinates of parameters."""

    parameters: Sequence[Parameter]
    matrix: Floats

    @classmethod
    def of(cls, parameters: Sequence[Parameter], whitened: Floats) -> Information:
        """Of a Jacobian (n, k) of readings whose covariance is one."""
        return cls(parameters, whitened.T @ whitened)

    @property
    def alone(self) -> Floats:
        """Bounds (k,) of each coordinate if all others were known; inf without information."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / np.sqrt(np.diag(self.matrix)))

    @property
    def uninformed(self) -> list[Parameter]:
        """Parameters on which the readings do not depend."""
        limits = [MAX_SIGMA if each.positive else np.inf for each in self.parameters]
        return [
            each
            for each, alone, limit in zip(self.parameters, self.alone, limits, strict=True)
            if not alone < limit
        ]

    def only(self, some: Sequence[Parameter]) -> Information:
        """Information of some parameters if the others were known."""
        kept = [number for number, each in enumerate(self.parameters) if each in some]
        return Information([self.parameters[k] for k in kept], self.matrix[np.ix_(kept, kept)])

    @property
    def condition(self) -> float:
        """Condition number, of coordinates in units of their own bounds."""
        strength = self._modes[0]
        return float(strength[-1] / strength[0]) if strength[0] > 0 else np.inf

    @property
    def indistinct(self) -> bool:
        """Whether a combination of parameters is not determined."""
        return not self.condition < MAX_CONDITION

    @property
    def weakest(self) -> str:
        """The combination of parameters that readings determine least, in words."""
        own = self._modes[1][:, 0]
        own = own / own[np.abs(own).argmax()]
        kept = np.flatnonzero(np.abs(own) > MIN_PART).tolist()
        names = [self.parameters[k].name for k in kept]
        if not all(self.parameters[k].positive for k in kept):
            parts = [f"{own[k]:+.2g} {name}" for k, name in zip(kept, names, strict=True)]
            return " ".join(parts) + ", each in units of its own bound"
        direction = (own * self.alone)[kept]
        direction /= direction[np.abs(direction).argmax()]
        return " · ".join(map(_power, names, direction.tolist()))

    @property
    def covariance(self) -> Floats:
        """Cramér–Rao bound (k, k) of the coordinates' covariance."""
        scale = self.alone
        strength, modes = self._modes
        return np.asarray((modes / strength) @ modes.T * np.outer(scale, scale))

    @property
    def _modes(self) -> tuple[Floats, Floats]:
        scale = self.alone
        strength, modes = np.linalg.eigh(self.matrix * np.outer(scale, scale))
        return strength, modes


def _power(name: str, exponent: float) -> str:
    return name if abs(exponent - 1) < 0.05 else f"{name}^{exponent:.2g}"
