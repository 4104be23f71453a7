"""Ranges that explain two readings of a spot exactly, for each fog of a grid.

With readings p, and those of unit reflectance and unit backscattering t(r) and f(r), all complex, a
target at r in fog of backscattering beta has the reflectance (p - beta f) / t: real at a root, and
positive. Everything that does not depend on the readings is tabulated once.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Floats
from ...capture import Optics
from ...capture.readings.cw import CwSpots
from ...capture.readings.pulsed import PulsedSpots
from ..brightness import bucket_optics
from .modes import Indices
from .overlap import overlap, path_lengths
from .target_prior import INTERVALS, interval_log_prior
from .templates import PATCH_STEP, STEP_M, make_templates

STRIDE = 8
"""Template steps between ranges at which roots are bracketed."""
OUTSIDE = 2.0
"""Steps by which a root may lie outside its bracket, as amplitudes bend."""
MIN_REFLECTANCE = 1e-12
"""Minimum reflectance."""


@dataclass(frozen=True, eq=False)
class Roots:
    """Ranges that explain a spot's readings in a fog exactly, each (C,).

    ``spot``, ``node`` (of extinction) and ``draw`` (of backscattering) are indices, in whose order
    roots are sorted; ``noise_m2`` is the variance of the range in this uneven fog, ``reading_m2``
    that of noise alone, ``strength`` the target in standard deviations, ``log_prior`` the log prior
    of range and reflectance over the Jacobian of the readings. A pixel has ``pixel_surface``
    electrons of the target and ``pixel_veil`` of the fog.
    """

    spot: Indices
    node: Indices
    draw: Indices
    range_m: Floats
    noise_m2: Floats
    reading_m2: Floats
    strength: Floats
    signal: Floats
    log_prior: Floats
    pixel_surface: Floats
    pixel_veil: Floats


@dataclass(frozen=True, eq=False)
class Symmetric:
    """Symmetric 2 x 2 matrices, each entry (...)."""

    xx: Floats
    xy: Floats
    yy: Floats

    @classmethod
    def of(cls, matrices: Floats) -> "Symmetric":
        """Entries of an array (..., 2, 2)."""
        return cls(matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 1])

    def at(self, index: Indices) -> "Symmetric":
        """A subset along one axis."""
        return Symmetric(self.xx[index], self.xy[index], self.yy[index])

    def plus(self, other: "Symmetric", times: Floats) -> "Symmetric":
        """Sum with other matrices scaled by ``times``."""
        return Symmetric(
            self.xx + times * other.xx, self.xy + times * other.xy, self.yy + times * other.yy
        )

    def variance(self, x: Floats, y: Floats) -> Floats:
        """Quadratic form of vectors."""
        return np.asarray(x * x * self.xx + 2 * x * y * self.xy + y * y * self.yy)

    @property
    def determinant(self) -> Floats:
        """Determinants."""
        return np.asarray(self.xx * self.yy - self.xy**2)

    def squares(self, x: Floats, y: Floats) -> Floats:
        """Chi squared of vectors with this covariance."""
        return np.asarray(
            (x * x * self.yy - 2 * x * y * self.xy + y * y * self.xx) / self.determinant
        )


class RootTables:
    """Readings of a recording by spot, extinction (K,) and range (R,).

    ``range_m`` (R,). ``empty_x`` and ``empty_y`` (4, K) are readings of unit backscattering up to
    the last range, ``empty_uneven`` (4, K) their covariance in uneven fog, and ``empty_pixel`` (4,
    K) the electrons of a pixel, None without an image.
    """

    def __init__(
        self,
        spots: CwSpots | PulsedSpots,
        optics: Optics | None,
        response: Callable[[Floats], Floats],
        max_range_m: float,
        extinctions_per_m: Floats,
    ) -> None:
        self._max_range_m = max_range_m
        intervals = INTERVALS if isinstance(spots, CwSpots) else 1
        ends_m = max_range_m * intervals + STRIDE * STEP_M
        made = make_templates(spots, response, ends_m, extinctions_per_m)
        self.range_m = made.range_m
        self._shape = made.target.shape[:2]
        target, fog = (table.swapaxes(0, 2).swapaxes(1, 2) for table in (made.target, made.fog))
        pixel_target, pixel_fog = np.zeros((2, *self._shape, self.range_m.size))
        self.empty_pixel: Floats | None = None
        if photodiodes := bucket_optics(optics, spots):
            assert optics is not None
            weight = np.sum([overlap(each, made.range_m)[0] for each in photodiodes], axis=0)
            path_m = np.mean([path_lengths(each, made.range_m) for each in photodiodes], axis=0)
            damped = np.exp(-extinctions_per_m[:, None] * path_m[:, None])
            seen = np.mean(optics.pixel_electrons) * weight[:, None] * damped
            pixel_target, pixel_fog = seen / np.pi, (np.cumsum(seen, axis=-1) - seen / 2) * STEP_M
            self.empty_pixel = pixel_fog[..., -1]
        tables = np.array([*target, *fog, pixel_target, pixel_fog])
        self._tables: Floats = tables.reshape(len(tables), -1)
        self.empty_x, self.empty_y = fog[..., -1]
        uneven = Symmetric.of(made.uneven)
        self.empty_uneven = uneven.at(np.s_[..., -1])  # type: ignore[arg-type]
        self._patches = made.uneven.shape[2]
        self._uneven = Symmetric(uneven.xx.ravel(), uneven.xy.ravel(), uneven.yy.ravel())
        self._x, self._y, fog_x, fog_y = np.concatenate([target, fog])[..., ::STRIDE].copy()
        self._echo_across: Floats = fog_y * self._x - fog_x * self._y
        self._echo_along: Floats = fog_x * self._x + fog_y * self._y

    def roots(
        self,
        pairs: Floats,
        covariance: Symmetric,
        backscatter: Floats,
        log_density: Callable[[Floats], Floats],
    ) -> Roots:
        """All roots for readings (S, 2) of covariance (S,) and rising backscattering (K, B)."""
        spot, node, draw, coarse = self._crossings(pairs, backscatter)
        (x, y), beta = pairs[spot].T, backscatter[node, draw]
        table = spot * self._shape[1] + node
        at = np.minimum(coarse, self.range_m.size - 2)
        here = table * self.range_m.size + at
        before, behind = self._tables[:, here], self._tables[:, here + 1]
        fraction = np.clip(
            _crossed(*(_across(x, y, beta, end) for end in (before, behind))), -OUTSIDE, 1 + OUTSIDE
        )
        slope_x, slope_y = (behind[:2] - before[:2]) / STEP_M
        target_x, target_y, fog_x, fog_y, pixel_target, pixel_fog = before + fraction * (
            behind - before
        )
        square = target_x**2 + target_y**2
        size = np.sqrt(square)
        along = (x - beta * fog_x) * target_x + (y - beta * fog_y) * target_y
        reflectance = np.maximum(along / square, MIN_REFLECTANCE)
        # A farther target also has more fog in front of it.
        farther_x = reflectance * slope_x + np.pi * beta * target_x
        farther_y = reflectance * slope_y + np.pi * beta * target_y
        jacobian = np.abs(farther_x * target_y - farther_y * target_x)
        patch = table * self._patches + np.minimum(at // PATCH_STEP, self._patches - 1)
        reading = covariance.at(spot)
        noise = reading.plus(self._uneven.at(patch), beta**2)
        unit_x, unit_y = target_x / size, target_y / size
        with np.errstate(divide="ignore", over="ignore"):
            stretch = (size / jacobian) ** 2
            noise_m2, reading_m2 = (
                each.variance(-unit_y, unit_x) * stretch for each in (noise, reading)
            )
            log_prior = log_density(reflectance) - np.log(jacobian * self._max_range_m)
        range_m = self.range_m[at] + fraction * STEP_M
        log_prior += interval_log_prior(range_m, self._max_range_m)
        return Roots(
            spot=spot,
            node=node,
            draw=draw,
            range_m=range_m,
            noise_m2=noise_m2,
            reading_m2=reading_m2,
            strength=reflectance * size / np.sqrt(noise.variance(unit_x, unit_y)),
            signal=reflectance * size,
            log_prior=np.where(jacobian > 0, log_prior, -np.inf),
            pixel_surface=reflectance * pixel_target,
            pixel_veil=beta * pixel_fog,
        )

    def _crossings(
        self, pairs: Floats, backscatter: Floats
    ) -> tuple[Indices, Indices, Indices, Indices]:
        """Spot, node and draw of each root, and the table step before it.

        Between two ranges a root exists for some backscattering only if it does between the minimum
        and the maximum: only those ranges are searched for all.
        """
        x, y = pairs.T[..., None, None]
        across, along = y * self._x - x * self._y, x * self._x + y * self._y
        ends = [across - backscatter[:, end, None] * self._echo_across for end in (0, -1)]
        above = (ends[0] > 0) & (ends[1] > 0)
        below = (ends[0] < 0) & (ends[1] < 0)
        minimum = backscatter[:, 0, None] * self._echo_along
        maximum = backscatter[:, -1, None] * self._echo_along
        ahead = along > np.minimum(minimum, maximum)
        same = (above[..., 1:] & above[..., :-1]) | (below[..., 1:] & below[..., :-1])
        table, cell = np.nonzero(
            (ahead[..., 1:] & ahead[..., :-1] & ~same).reshape(-1, same.shape[-1])
        )
        here = table * across.shape[-1] + cell
        beta = backscatter.T[:, table % self._shape[1]]  # (B, cells)

        def at(position: Indices, whole: Floats, echo: Floats) -> Floats:
            return np.asarray(whole.ravel()[position] - beta * echo.ravel()[position])

        before, behind = (at(here + end, across, self._echo_across) for end in (0, 1))
        crossing = before * behind <= 0
        for end in (0, 1):
            crossing &= at(here + end, along, self._echo_along) > 0
        draw, result = np.nonzero(crossing)
        order = np.argsort(table[result] * len(beta) + draw, kind="stable")
        draw, result = draw[order], result[order]
        table, cell, fraction = (
            table[result],
            cell[result],
            _crossed(before[draw, result], behind[draw, result]),
        )
        coarse = cell * STRIDE + (STRIDE * fraction).astype(int)
        return *np.divmod(table, self._shape[1]), draw, coarse


def _across(x: Floats, y: Floats, beta: Floats, table: Floats) -> Floats:
    """Component of readings (C,) across the target's, in a ``table`` (6, C)."""
    return np.asarray((y - beta * table[3]) * table[0] - (x - beta * table[2]) * table[1])


def _crossed(before: Floats, behind: Floats) -> Floats:
    """Zero of a line through two values, as a fraction of the way between them."""
    fall = before - behind
    return np.divide(before, fall, out=np.zeros_like(fall), where=fall != 0)
