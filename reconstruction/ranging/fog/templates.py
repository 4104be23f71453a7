"""What unit reflectance and unit backscattering leave in the readings, at every range."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.arrays import Floats
from ...capture.spots import SpotOptics
from .overlap import overlap, path_lengths

STEP_M = 0.01
"""Between ranges in the tables."""
INTEGRATION_STEPS = 4
"""Steps of the fog's integral within one of the table."""
OVERLAP_STEP_M = 0.02
"""Between ranges for which the overlap of beams and fields is computed."""
PATCH_STEP = 25
"""Steps of the table between ranges at which the echo of uneven fog is known."""
SEARCH = 4
"""Steps of the table between ranges where minima are looked for."""
EXTINCTIONS_PER_M = np.array([0.002, 0.01, 0.025, 0.045, 0.07, 0.1, 0.15, 0.22, 0.32])
"""From what no range feels to 10 m of visibility."""
UNEVENNESS = 0.25
"""Rms deviation of the fog's density along a beam from its mean, relative."""
PATCH_M = 1.0
"""Length over which densities resemble each other: correlation exp(-distance / PATCH_M)."""
NOMINAL_ELECTRONS_PER_JOULE = 5e18
"""Where it is not known: 7 in 10 photons of 1550 nm, behind a lens and a filter."""


@dataclass(frozen=True, eq=False)
class Templates:
    """Tables over spots, K extinctions and R ranges, in n combinations of readings.

    ``target`` (4, K, n, R) for unit reflectance, ``fog`` (4, K, n, R) for unit backscattering up to
    that range, ``uneven`` (4, K, P, n, n) the covariance that unevenness adds to it per squared
    backscattering, at every PATCH_STEP-th range.
    """

    range_m: Floats
    extinction_per_m: Floats
    target: Floats
    fog: Floats
    uneven: Floats

    @cached_property
    def searched(self) -> tuple[Floats, Floats]:
        """Target and fog at every SEARCH-th range."""
        return self.target[..., ::SEARCH].copy(), self.fog[..., ::SEARCH].copy()

    def rougher(self, times: float) -> "Templates":
        """The same of fog that deviates from its mean so many times more."""
        return replace(self, uneven=times**2 * self.uneven)


def make_templates(
    optics: SpotOptics,
    response: Callable[[Floats], Floats],
    max_range_m: float,
    extinctions_per_m: Floats = EXTINCTIONS_PER_M,
) -> Templates:
    """Tables up to a range; ``response`` gives readings (n, ...) of all light by its path (...)."""
    fine_m = np.arange(STEP_M / INTEGRATION_STEPS, max_range_m, STEP_M / INTEGRATION_STEPS)
    coarse_m = np.arange(0.0, max_range_m + OVERLAP_STEP_M, OVERLAP_STEP_M) + STEP_M
    weight = np.array([np.interp(fine_m, coarse_m, w) for w in overlap(optics, coarse_m)[0]])
    path_m = path_lengths(optics, fine_m)
    kernel = np.stack([response(path) for path in path_m])  # (4, n, fine)
    keep = slice(INTEGRATION_STEPS - 1, None, INTEGRATION_STEPS)
    target, fog, uneven = [], [], []
    for extinction in extinctions_per_m:
        seen = (weight * np.exp(-extinction * path_m))[:, None] * kernel
        density = seen * (STEP_M / INTEGRATION_STEPS)
        target.append(seen[..., keep] / np.pi)
        fog.append((np.cumsum(density, axis=-1) - density / 2)[..., keep])
        uneven.append(_uneven(density[..., : len(fine_m) // INTEGRATION_STEPS * INTEGRATION_STEPS]))
    return Templates(
        range_m=fine_m[keep],
        extinction_per_m=extinctions_per_m,
        target=np.stack(target, axis=1),
        fog=np.stack(fog, axis=1),
        uneven=np.stack(uneven, axis=1),
    )


def _uneven(density: Floats) -> Floats:
    """Covariance (4, P, n, n) of the echo up to every PATCH_STEP-th range, of cells (4, n, fine).

    The exponential correlation lets it grow cell by cell: what a new cell shares with all before it
    fades by exp(-step / PATCH_M), and so is a running sum of cells that grow instead.
    """
    cells = density.reshape(*density.shape[:2], -1, INTEGRATION_STEPS).sum(axis=-1)
    growth = np.exp(np.arange(cells.shape[-1]) * STEP_M / PATCH_M)
    grown_cells = cells * growth
    carried = (np.cumsum(grown_cells, axis=-1) - grown_cells) / growth
    shared = np.einsum("sik,sjk->skij", cells, carried)
    grown = shared + shared.swapaxes(2, 3) + np.einsum("sik,sjk->skij", cells, cells)
    return UNEVENNESS**2 * np.cumsum(grown, axis=1)[:, ::PATCH_STEP]
