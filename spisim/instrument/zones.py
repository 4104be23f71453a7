"""Zones of a ranging sensor: one flood of light, and a receiver that sees a field in each zone."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field, model_validator

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.spots import MAX_SPOTS
from spisim.base.config import Count, NonNegative, Number, Positive, Section
from spisim.instrument.steering import directions

FullAngle = Annotated[Number, Field(ge=0.1, le=150)]
Leak = Annotated[Number, Field(ge=0, le=0.5)]
#: Points per side of a zone over which its response is averaged.
POINTS = 16
#: Exponent of the cosine by which a bare aperture's image darkens off its axis.
BARE_LENS = 4


class Zones(Section):
    """One flood of light, and a receiver whose field is divided into zones.

    The flood is a cone from the projector's pinhole, along the optical axis. The receiver is
    `tof.detector`, with one position and a lens whose field holds all zones. Its sensor's area is
    that of all zones together, its rates and its dead time are those of one. All zones measure at
    the same time, and their histograms hold the light of all surfaces in their fields.
    """

    shape: tuple[Count, Count]
    """[rows, columns] of zones, at most 64; they tile the field."""
    fov_deg: tuple[FullAngle, FullAngle]
    """[across, down]: full angles of the whole field, through its middle."""
    power_w: Positive
    """Power of the flood: mean of continuous light, peak of a pulse."""
    flood_deg: FullAngle
    """Full angle of the flood's cone."""
    flood_falloff: Annotated[Number, Field(ge=-4, le=100)] = 0.0
    """Exponent n: the flood's intensity falls as cosⁿ inside the cone; -3 lights a wall evenly."""
    crosstalk: Leak = 0.0
    """Fraction of a zone's light that adjacent zones receive, in equal parts."""
    near_overlap_m: NonNegative | tuple[NonNegative, ...] = 0.0
    """Range a below which a zone hardly sees what the flood lights, as exp(-(a / range)²).

    One for all zones, or one for each, by rows."""
    cover_glass: Leak = 0.0
    """Fraction of the flood's power that returns at once to the receiver, evenly to all zones."""

    @property
    def tan_half(self) -> tuple[float, float]:
        """Half width and half height of the field at unit distance."""
        across, down = (math.tan(math.radians(full) / 2) for full in self.fov_deg)
        return across, down

    @property
    def directions_deg(self) -> tuple[tuple[float, float], ...]:
        """[azimuth, elevation] of the middle of each zone, by rows from the top left."""
        x, y, _ = self.points(1)[:, 0].T
        azimuth, elevation = np.arctan(x), -np.arctan2(y, np.hypot(x, 1))
        return tuple(map(tuple, np.degrees([azimuth, elevation]).T.tolist()))

    @property
    def directions(self) -> Floats:
        """Unit vectors (zones, 3) through the middle of each zone, optical frame."""
        return directions(self.directions_deg)

    @property
    def solid_angle(self) -> float:
        """Area of a zone at unit distance."""
        return 4 * math.prod(self.tan_half) / math.prod(self.shape)

    #: A zone as a beam from the receiver: Gaussian, with the standard deviation of its field.
    waist_mm: ClassVar[float] = 0.0
    #: Nothing turns it.
    steering: ClassVar[None] = None

    @property
    def divergence_mrad(self) -> float:
        """Standard deviation of the angle in a zone, per axis."""
        return 1e3 * math.sqrt(self.solid_angle / 12)

    def responses(self, vignetting: float) -> Floats:
        """Mean (zones,) over each zone's image of cos⁴ and of the lens's cosᵐ, m = `vignetting`."""
        squared = np.sum(self.points(POINTS) ** 2, axis=-1)
        return np.asarray(np.mean(squared ** (-(BARE_LENS + vignetting) / 2), axis=1))

    @property
    def axial_intensity(self) -> float:
        """Radiant intensity of the flood along its axis, per watt, 1/sr."""
        cosine, power = math.cos(math.radians(self.flood_deg) / 2), self.flood_falloff + 1
        integral = (1 - cosine**power) / power if power else -math.log(cosine)
        return 1 / (2 * math.pi * integral)

    @property
    def peak_intensity(self) -> float:
        """Maximum radiant intensity of the flood, per watt, 1/sr."""
        edge = math.cos(math.radians(self.flood_deg) / 2) ** self.flood_falloff
        return self.axial_intensity * max(1.0, edge)

    @property
    def mixing(self) -> Floats:
        """Fractions (zones, zones) of the light of each zone, in columns, that zones receive."""
        rows, columns = np.divmod(np.arange(math.prod(self.shape)), self.shape[1])
        apart = np.maximum(*(np.abs(each[:, None] - each) for each in (rows, columns)))
        beside = (apart == 1).astype(np.float64)
        leaked = self.crosstalk * beside / np.maximum(beside.sum(axis=0), 1)
        return np.asarray(leaked + np.diag(1 - leaked.sum(axis=0)))

    def overlap(self, path_m: Floats) -> Floats:
        """Fractions (zones, paths) of an echo's light that zones see, by path length (paths,).

        Behind lenses beside each other, the images of the lit field and of the diodes part by an
        angle that falls with the range; both have soft edges, which count as Gaussian.
        """
        near = np.broadcast_to(self.near_overlap_m, math.prod(self.shape))[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.exp(-np.where(near > 0, (2 * near / path_m) ** 2, 0)))

    @property
    def corner_deg(self) -> float:
        """Full angle of the cone that holds the field."""
        return 2 * math.degrees(math.atan(math.hypot(*self.tan_half)))

    def points(self, parts: int) -> Floats:
        """Middles (zones, parts², 3) of parts of each zone at unit distance."""
        y, x = (
            (2 * (np.arange(count * parts) + 0.5) / (count * parts) - 1) * half
            for count, half in zip(self.shape, reversed(self.tan_half), strict=True)
        )
        grid = np.stack([*np.meshgrid(x, y), np.ones((y.size, x.size))], axis=-1)
        rows, columns = self.shape
        parted = grid.reshape(rows, parts, columns, parts, 3).swapaxes(1, 2)
        return parted.reshape(rows * columns, parts**2, 3)

    @model_validator(mode="after")
    def _lit_zones_few_enough(self) -> Zones:
        zones = math.prod(self.shape)
        if zones > MAX_SPOTS:
            raise InputError(
                f"shape {list(self.shape)} has {zones} zones; at most {MAX_SPOTS}, such as [8, 8]"
            )
        if isinstance(self.near_overlap_m, tuple) and len(self.near_overlap_m) != zones:
            raise InputError(
                f"near_overlap_m has {len(self.near_overlap_m)} values; one, or {zones} for the "
                f"zones of shape {list(self.shape)}"
            )
        off_deg = float(np.degrees(np.arccos(self.directions[:, 2].min())))
        if off_deg > self.flood_deg / 2:
            raise InputError(
                f"flood_deg {self.flood_deg:g} leaves zones dark, whose middles lie up to "
                f"{off_deg:.4g}° off the axis; at least {2 * off_deg:.4g}"
            )
        return self
