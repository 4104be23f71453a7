"""Inhomogeneous fog: patches, layers, a plume, and their drift.

A density field multiplies a medium's extinction within a box. Its initial mean over the box is 1,
so the given extinction is the mean.

Patches are log-normal: exp(s g - s²/2) of a Gaussian random field g with correlation exp(-r²/l²).
They have mean 1, rms over mean c = √(exp(s²) - 1), and correlation (exp(s² exp(-r²/l²)) - 1) / c²,
which defines l by being 1/e at the correlation length. The field is a sum of waves with random
directions, lengths and phases (Shinozuka & Jan, J. Sound Vib. 25, 111 (1972)). It has no edges and
no period, and drifts unchanged with the wind (Taylor's frozen turbulence, valid for seconds).
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config import NonNegative, Number, Positive, Section, Vector

#: Waves in a field, enough to make it Gaussian.
WAVES = 1024
#: Cells per shortest length of a field, and the maximum cells in a box.
CELLS_PER_LENGTH = 4
MAX_CELLS = 2**22


class Layer(Section):
    """Ground fog: 1 / (1 + exp((z - top) / edge))."""

    top_m: Number
    """World height at which the density is half of that on the ground."""
    edge_m: Positive
    """Height over which it falls by a factor e, far above the top."""

    def density(self, points: Floats) -> Floats:
        """Density, 0 to 1, at world points (..., 3)."""
        return np.asarray(0.5 - 0.5 * np.tanh((points[..., 2] - self.top_m) / (2 * self.edge_m)))


class Plume(Section):
    """Gaussian smoke that widens from a source, with the same flux through each cross section."""

    source_m: Vector
    """Position of the source, world coordinates."""
    direction: Vector
    """Direction of the plume."""
    width_m: Positive
    """Standard deviation across, per axis, at the source."""
    spread: NonNegative = 0.1
    """Growth of the width per metre."""

    @model_validator(mode="after")
    def _goes_somewhere(self) -> Plume:
        if not any(self.direction):
            raise InputError("plume.direction should not be zero")
        return self

    def density(self, points: Floats) -> Floats:
        """Density at world points (..., 3), relative to the source."""
        heading = np.array(self.direction) / np.linalg.norm(self.direction)
        offset = points - np.array(self.source_m)
        along = offset @ heading
        aside2 = np.sum(offset**2, axis=-1) - along**2
        width = self.width_m + self.spread * np.maximum(along, 0)
        behind2 = np.minimum(along, 0) ** 2
        return np.asarray(
            (self.width_m / width) ** 2
            * np.exp(-(aside2 / width**2 + behind2 / self.width_m**2) / 2)
        )


class Structure(Section):
    """Density of a medium relative to its mean over a box; patches drift with the wind."""

    contrast: Annotated[Number, Field(ge=0, le=3)] = 0.0
    """Rms of the density over its mean; 0 without patches."""
    correlation_length_m: Positive = 1.0
    """Distance at which the correlation of patches is 1/e."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the patches."""
    wind_m_s: Vector = (0.0, 0.0, 0.0)
    """Drift velocity of the patches."""
    layer: Layer | None = None
    """Ground fog."""
    plume: Plume | None = None
    """Smoke from a source."""

    @property
    def drifts(self) -> bool:
        """Whether it changes with time."""
        return self.contrast > 0 and any(self.wind_m_s)

    def density(self, to_world: Floats, time_s: float = 0.0) -> NDArray[np.float32]:
        """Relative density (nz, ny, nx) in the cells of a box, placed by `to_world` (4, 4)."""
        shape = self._cells(to_world)
        outline = self._outline(to_world, shape)
        start = self.patches(to_world, shape) * outline
        mean = start.mean()
        if not mean > 1e-12:
            raise InputError("structure: layer or plume leaves nothing in the box of the volume")
        if self.drifts and time_s != 0:
            start = self.patches(to_world, shape, time_s) * outline
        return np.asarray(start / mean, dtype=np.float32)

    def patches(self, to_world: Floats, shape: tuple[int, int, int], time_s: float = 0.0) -> Floats:
        """The log-normal field, of expectation 1, at cell centres (nz, ny, nx)."""
        if self.contrast == 0:
            return np.ones(shape)
        spread = np.sqrt(np.log1p(self.contrast**2))
        at_length = np.log1p(self.contrast**2 / np.e) / spread**2  # g's correlation there
        length = self.correlation_length_m / np.sqrt(-np.log(at_length))
        rng = np.random.default_rng(self.seed)
        waves = rng.normal(0, np.sqrt(2) / length, (WAVES, 3))
        phases = rng.uniform(0, 2 * np.pi, WAVES)
        phases += waves @ (to_world[:3, 3] - np.multiply(self.wind_m_s, time_s))
        turns = waves @ to_world[:3, :3]  # phase across the box, per edge
        x, y, z = (
            np.exp(1j * np.outer(centres(count), turn))
            for count, turn in zip(shape[::-1], turns.T, strict=True)
        )
        z = z * np.exp(1j * phases)
        # The phase is a sum over the edges, so the field is a product of waves, layer by layer.
        field = np.array([((y * layer) @ x.T).real for layer in z])
        return np.asarray(np.exp(spread * np.sqrt(2 / WAVES) * field - spread**2 / 2))

    def _outline(self, to_world: Floats, shape: tuple[int, int, int]) -> Any:
        """Density of layer and plume (nz, ny, nx), or 1."""
        parts = [part for part in (self.layer, self.plume) if part is not None]
        if not parts:
            return 1.0
        grid = np.meshgrid(*(centres(count) for count in shape), indexing="ij")
        points = np.stack(grid[::-1], axis=-1) @ to_world[:3, :3].T + to_world[:3, 3]
        return np.prod([part.density(points) for part in parts], axis=0)

    def _cells(self, to_world: Floats) -> tuple[int, int, int]:
        """Number of cells (nz, ny, nx)."""
        lengths = [self.correlation_length_m] if self.contrast > 0 else []
        lengths += [self.layer.edge_m] if self.layer is not None else []
        lengths += [self.plume.width_m] if self.plume is not None else []
        edges = np.linalg.norm(to_world[:3, :3], axis=0)
        cell_m = min(lengths, default=edges.max()) / CELLS_PER_LENGTH
        nx, ny, nz = (int(count) for count in np.maximum(np.ceil(edges / cell_m), 1))
        if nx * ny * nz > MAX_CELLS:
            raise InputError(
                f"structure: a length of {min(lengths):g} m in a box of "
                f"{' x '.join(f'{edge:g}' for edge in edges)} m needs {nx * ny * nz} cells; at "
                f"most {MAX_CELLS}: make correlation_length_m, edge_m or width_m longer"
            )
        return nz, ny, nx


def centres(count: int) -> Floats:
    """Centres (count,) of the cells along an edge of length 1."""
    return (np.arange(count) + 0.5) / count
