"""Readings of unit reflectance and of unit backscattering at every range."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arrays import Floats
from ...capture.spots import SpotOptics
from .overlap import overlap, path_lengths

STEP_M = 0.01
"""Range step of the tables."""
INTEGRATION_STEPS = 4
"""Steps of the fog integral per table step."""
OVERLAP_STEP_M = 0.02
"""Range step of the overlap of beams and fields."""
PATCH_STEP = 25
"""Table steps between ranges with a covariance of uneven fog."""
SEARCH = 4
"""Table steps between ranges at which minima are searched."""
EXTINCTIONS_PER_M = np.array([0.002, 0.01, 0.025, 0.045, 0.07, 0.1, 0.15, 0.22, 0.32])
"""From negligible extinction to 10 m of visibility."""
UNEVENNESS = 0.25
"""Relative rms deviation of the fog's density along a beam."""
PATCH_M = 1.0
"""Correlation length of the density: exp(-distance / PATCH_M)."""
NOMINAL_ELECTRONS_PER_JOULE = 5e18
"""Default if unknown: 7 in 10 photons of 1550 nm, behind a lens and a filter."""


@dataclass(frozen=True, eq=False)
class Templates:
    """Tables over S spots, K extinctions and R ranges, in n combinations of readings.

    ``target`` (S, K, n, R) for unit reflectance, ``fog`` (S, K, n, R) for unit backscattering up to
    that range, ``uneven`` (S, K, P, n, n) the covariance that unevenness adds per squared
    backscattering, at every PATCH_STEP-th range. Ranges beyond ``unambiguous_m`` have the phases of
    nearer ones.
    """

    range_m: Floats
    extinction_per_m: Floats
    target: Floats
    fog: Floats
    uneven: Floats
    unambiguous_m: float

    @cached_property
    def searched(self) -> tuple[Floats, Floats]:
        """Target and fog at every SEARCH-th range."""
        return self.target[..., ::SEARCH].copy(), self.fog[..., ::SEARCH].copy()

    @property
    def typical_uneven(self) -> Floats:
        """Covariance (S, K, n, n) of a target half the unambiguous range away."""
        middle = np.searchsorted(self.range_m, self.unambiguous_m / 2) // PATCH_STEP
        return self.uneven[:, :, middle]

    def rougher(self, times: float) -> "Templates":
        """The same for fog whose density deviates ``times`` as much."""
        return replace(self, uneven=times**2 * self.uneven)


def make_templates(
    optics: SpotOptics,
    response: Callable[[Floats], Floats],
    max_range_m: float,
    extinctions_per_m: Floats = EXTINCTIONS_PER_M,
    *,
    unambiguous_m: float = np.inf,
) -> Templates:
    """Tables up to a range; ``response`` maps the path (...) of all light to readings (n, ...)."""
    fine_m = np.arange(STEP_M / INTEGRATION_STEPS, max_range_m, STEP_M / INTEGRATION_STEPS)
    coarse_m = np.arange(0.0, max_range_m + OVERLAP_STEP_M, OVERLAP_STEP_M) + STEP_M
    weight = np.array([np.interp(fine_m, coarse_m, w) for w in overlap(optics, coarse_m)[0]])
    path_m = path_lengths(optics, fine_m)
    kernel = np.stack([response(path) for path in path_m])  # (S, n, fine)
    keep = slice(INTEGRATION_STEPS - 1, None, INTEGRATION_STEPS)
    target, fog, uneven = [], [], []
    for extinction in extinctions_per_m:
        seen = (weight * np.exp(-extinction * path_m))[:, None] * kernel
        density = seen * (STEP_M / INTEGRATION_STEPS)
        # The readings of a range are neighbours in memory, as they are used together.
        target.append((seen[..., keep] / np.pi).swapaxes(1, 2))
        fog.append((np.cumsum(density, axis=-1) - density / 2)[..., keep].swapaxes(1, 2))
        uneven.append(_uneven(density[..., : len(fine_m) // INTEGRATION_STEPS * INTEGRATION_STEPS]))
    return Templates(
        range_m=fine_m[keep],
        extinction_per_m=extinctions_per_m,
        target=np.ascontiguousarray(np.stack(target, axis=1)).swapaxes(2, 3),
        fog=np.ascontiguousarray(np.stack(fog, axis=1)).swapaxes(2, 3),
        uneven=np.stack(uneven, axis=1),
        unambiguous_m=min(unambiguous_m, max_range_m),
    )


def _uneven(density: Floats) -> Floats:
    """Covariance (S, P, n, n) of the echo up to every PATCH_STEP-th range, of cells (S, n, fine).

    With exponential correlation it grows cell by cell: the covariance of a new cell with those
    before fades by exp(-step / PATCH_M), as a running sum of growing cells does.
    """
    cells = density.reshape(*density.shape[:2], -1, INTEGRATION_STEPS).sum(axis=-1)
    growth = np.exp(np.arange(cells.shape[-1]) * STEP_M / PATCH_M)
    grown_cells = cells * growth
    carried = (np.cumsum(grown_cells, axis=-1) - grown_cells) / growth
    shared = np.einsum("sik,sjk->skij", cells, carried)
    grown = shared + shared.swapaxes(2, 3) + np.einsum("sik,sjk->skij", cells, cells)
    return UNEVENNESS**2 * np.cumsum(grown, axis=1)[:, ::PATCH_STEP]
