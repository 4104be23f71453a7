"""Phase functions from tables of two columns."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere.phase import G_TOLERANCE, Tabulated

#: Nodes of the resampled table, for the forward lobe of large droplets: with 1001, heavy advection
#: fog would get g = 0.950 instead of 0.868.
NODES = 100_001
#: Tolerance of the integral of a table in 1/sr.
NORMALISATION_TOLERANCE = 0.01


class _Columns(NamedTuple):
    """A table, linear between its rows in the cosine or the angle."""

    x: Floats  # rising, over the full range: cosine, or angle in rad
    values: Floats
    in_angle: bool

    def at(self, cos: Floats) -> Floats:
        x = np.arccos(np.clip(cos, -1, 1)) if self.in_angle else cos
        return np.asarray(np.interp(x, self.x, self.values))

    def moments(self) -> tuple[float, float]:
        """∫ p dΩ and mean cosine of the table."""
        nodes, weights = np.polynomial.legendre.leggauss(8)
        half = np.diff(self.x)[:, None] / 2
        x = self.x[:-1, None] + half * (1 + nodes)
        cos, measure = (np.cos(x), np.sin(x)) if self.in_angle else (x, np.ones_like(x))
        density = weights * half * measure * np.interp(x, self.x, self.values)
        integral = density.sum()
        return float(2 * np.pi * integral), float((density * cos).sum() / integral)


def tabulate(
    table: ArrayLike,
    *,
    per_steradian: bool = False,
    declared_g: float | None = None,
    name: str = "table",
) -> Tabulated:
    """Phase function from rows of (cosine, value) or (angle in degrees, value).

    The table is resampled to `NODES` uniform steps of the cosine and must keep its asymmetry.

    Parameters
    ----------
    table : (rows, 2) array
        The first column rises or falls over the full range: -1 to 1 is a cosine, 0 to 180 an angle.
        Steps may be uneven; values are linear in between.
    per_steradian : bool
        Whether values are absolute and must integrate to 1.
    declared_g : float, optional
        Expected asymmetry.
    name : str
        What messages call the table.

    Raises
    ------
    InputError
        For another shape or range, a table that is not normalised, and one whose forward lobe is
        too narrow for it.
    """
    columns = _columns(np.asarray(table, dtype=np.float64), name)
    integral, own_g = columns.moments()
    if declared_g is not None and not abs(own_g - declared_g) <= G_TOLERANCE:
        raise InputError(
            f"phase function {name!r}: its {len(columns.x)} rows, linear in between, give "
            f"g = {own_g:.4f} instead of {declared_g:.4f}: the table is too coarse, or another one"
        )
    if per_steradian and not abs(integral - 1) <= NORMALISATION_TOLERANCE:
        raise InputError(
            f"phase function {name!r} in 1/sr should integrate to 1 over the sphere, within "
            f"{NORMALISATION_TOLERANCE:.0%}; its integral is {integral:.4g} and its g {own_g:.4f}, "
            f"with its {len(columns.x)} rows and linear in between"
        )
    values = columns.at(np.linspace(-1, 1, NODES))
    return Tabulated(values, own_g, name)


def _columns(table: Floats, name: str) -> _Columns:
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < 2:
        raise InputError(
            f"phase function {name!r} should have two columns, cosine or angle_deg and value, and "
            f"two or more rows; found shape {table.shape}"
        )
    x, values = table[:: 1 if table[0, 0] < table[-1, 0] else -1].T
    if not np.isfinite(table).all() or (values < 0).any() or not values.any():
        raise InputError(
            f"phase function {name!r} should have finite values of 0 or more, not all 0"
        )
    if not (np.diff(x) > 0).all():
        raise InputError(f"phase function {name!r}: its first column should rise or fall steadily")
    if np.allclose(x[[0, -1]], (-1, 1), atol=1e-6):
        return _Columns(x, values, in_angle=False)
    if np.allclose(x[[0, -1]], (0, 180), atol=1e-6):
        return _Columns(np.radians(x), values, in_angle=True)
    raise InputError(
        f"phase function {name!r}: its first column should span -1 to 1 (cosine) or 0 to 180 "
        f"(angle_deg); it spans {x[0]:g} to {x[-1]:g}"
    )
