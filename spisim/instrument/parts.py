"""Projector, pattern plan, filter and lasers, and quantities derived from their data sheets.

Positions are in the projector's optical frame: x right, y down, z forward, metres, origin at its
pinhole. Angles named `fov` or `field_of_view` are full angles.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError
from scipy.special import erf

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture import read_capture
from reconstruction.capture.spots import MAX_SPOTS
from reconstruction.operators import (
    BASES,
    Basis,
    PatternPlan,
    basis_of,
    interleaved,
    make_plan,
    plan_of_rows,
    with_throughput,
)
from spisim.base.config import Count, NonNegative, Number, Positive, Section, not_a_truth_value
from spisim.base.config.files import check_is_there, read_npy
from spisim.instrument.demodulation import Modulation
from spisim.instrument.sensor import FWHM_PER_SIGMA, PositiveFraction
from spisim.instrument.steering import AnySteering, directions

Angle = Annotated[Number, Field(gt=-90, lt=90)]
Band = tuple[float, float]


class Spectrum(Section):
    """Gaussian emission spectrum of an LED."""

    peak_nm: Positive
    """Peak wavelength."""
    fwhm_nm: Positive
    """Full width at half maximum."""

    def density(self, wavelength_nm: Floats) -> Floats:
        """Fraction of the power per nanometre."""
        sigma = self.fwhm_nm / FWHM_PER_SIGMA
        position = (wavelength_nm - self.peak_nm) / sigma
        return np.asarray(np.exp(-(position**2) / 2) / (sigma * math.sqrt(2 * math.pi)))

    def fraction_within(self, band_nm: Band) -> float:
        """Fraction of the power between two wavelengths."""
        scale = self.fwhm_nm / FWHM_PER_SIGMA * math.sqrt(2)
        low, high = ((edge - self.peak_nm) / scale for edge in band_nm)
        return float(erf(high) - erf(low)) / 2


#: Maximum pixels of a projector: light is traced for each.
MAX_PIXELS = 2**20


def _few_pixels(shape: tuple[int, int]) -> tuple[int, int]:
    if shape[0] * shape[1] > MAX_PIXELS:
        raise PydanticCustomError(
            "pixels",
            "should have at most {max} pixels, such as 1024 × 1024, not {pixels}",
            {"max": MAX_PIXELS, "pixels": shape[0] * shape[1]},
        )
    return shape


class Projector(Section):
    """The LED array and its patterns, a pinhole as seen from the scene."""

    shape: Annotated[tuple[Count, Count], AfterValidator(_few_pixels)]
    """[rows, columns] of square virtual pixels; at most 1024 × 1024."""
    fov_deg: Annotated[Number, Field(gt=0, lt=180)]
    """Full angle across the width."""
    power_w: Positive
    """Radiant power with all pixels on."""
    in_band_fraction: PositiveFraction | None = None
    """Fraction of the power within the filter's band. This or `spectrum`."""
    spectrum: Spectrum | None = None
    """Emission spectrum of the LEDs. This or `in_band_fraction`."""
    pattern_rate_hz: Annotated[Number, Field(gt=0, le=1e8)]
    """Patterns per second."""
    settling_time_s: NonNegative = 0.0
    """Time constant of a pattern's appearance; at most a fifth of its period."""
    on_off_contrast: Annotated[Number, Field(gt=1)] | None = None
    """Power of a lit pixel over that of a dark one; dark ones are black by default."""
    nonuniformity: Annotated[Number, Field(ge=0, le=0.5)] = 0.0
    """Rms spread of the pixels' power over its mean."""
    nonuniformity_seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the nonuniformity."""
    falloff: NonNegative = 0.0
    """Exponent n of cosⁿθ across the field; 4 for a plain lens."""
    lens_radius_m: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Radius of the lens; 0 is a pinhole, sharp everywhere."""
    focus_m: Positive = 1.0
    """Distance at which the lens is sharp."""
    modulation: Modulation | None = None
    """Modulation of the array, whose detector then yields taps for each pattern."""

    @property
    def pixel_fractions(self) -> Floats:
        """Fraction (H, W) of the power in each virtual pixel, fixed by shape and seed."""
        height, width = self.shape
        x = (2 * (np.arange(width) + 0.5) / width - 1) * self.tan_half_width
        y = (2 * (np.arange(height) + 0.5) / height - 1) * self.tan_half_height
        fraction = (1 + x**2 + y[:, None] ** 2) ** (-self.falloff / 2)
        rng = np.random.default_rng(self.nonuniformity_seed)
        spread = self.nonuniformity * rng.standard_normal(self.shape)
        fraction = fraction * np.maximum(1 + spread, 0)
        return np.asarray(fraction / fraction.sum())

    @property
    def dark_level(self) -> float:
        """Power of a dark pixel over that of a lit one."""
        return 0.0 if self.on_off_contrast is None else 1 / self.on_off_contrast

    @property
    def tan_half_width(self) -> float:
        """Half the width of the lit field at unit distance."""
        return math.tan(math.radians(self.fov_deg) / 2)

    @property
    def tan_half_height(self) -> float:
        """Half the height of the lit field at unit distance."""
        height, width = self.shape
        return self.tan_half_width * height / width

    @model_validator(mode="after")
    def _spectrum_is_stated_once(self) -> Projector:
        if (self.in_band_fraction is None) == (self.spectrum is None):
            raise InputError("needs either in_band_fraction or spectrum")
        return self


def _polarity(given: Any) -> Any:
    if given == "signed":
        raise InputError(
            "signed patterns are differences of exposures; choose differential or single-ended"
        )
    signs = given if isinstance(given, list | tuple) else ()
    if given not in get_args(Polarity) and not (signs and all(sign in (1, -1) for sign in signs)):
        raise PydanticCustomError(
            "polarity", "should be 'differential', 'single-ended' or a list of 1 and -1"
        )
    return given


Polarity = Literal["differential", "single-ended"]
RowNumber = Annotated[int, BeforeValidator(not_a_truth_value), Field(ge=0)]


#: Maximum frames until patterns repeat; more would assume a static scene.
MAX_INTERLEAVED = 256


class Throughput(Section):
    """Light that a pattern and its complement pass, relative to the mean: a list, or drawn."""

    factors: tuple[Positive, ...] | None = None
    """One for each pattern, in the order of exposure; their mean is scaled to 1."""
    edges: Annotated[Number, Field(ge=0, le=0.5)] = 0.0
    """Fraction lost by a pattern of which all neighbouring pixels differ."""
    spread: Annotated[Number, Field(ge=0, le=0.3)] = 0.0
    """Rms spread by chance."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the spread."""
    stated: bool = False
    """Whether captures state the throughput, as calibrated; otherwise it is to be found."""

    def of(self, plan: PatternPlan) -> PatternPlan:
        """The plan with this throughput; InputError if a list does not fit."""
        return with_throughput(plan, **self.model_dump(exclude={"stated"}))


class Plan(Section):
    """The patterns exposed: the first of an order, or those of an `index`, one by one.

    For orders see `reconstruction.make_plan`. An `index` lists row numbers in a `layout`, which is
    the basis's natural order or a named one; with one polarity per row they are the exposures. A
    basis without a formula, such as "dense", needs a `patterns_file`: transmittances from 0 to 1,
    (patterns, rows, columns), as an NPY file beside this file, or a capture that exposed them.

    With `interleave` the frames of a cycle differ: each exposes the first patterns of the order, a
    fraction `common`, and its own of the following ones.
    """

    patterns: Count | None = None
    """Number of patterns, the first of the `order`."""
    order: str | None = None
    """Name of an order of the basis, see below."""
    polarity: Annotated[Polarity | tuple[int, ...], BeforeValidator(_polarity)]
    """Each pattern and its complement, each once, or a sign for each entry of `index`."""
    index: Annotated[tuple[RowNumber, ...], Field(min_length=1)] | None = None
    """Row numbers to expose, in place of `patterns` and `order`."""
    layout: str | None = None
    """Order that `index` refers to: natural, or the name of another."""
    basis: str = "hadamard"
    """Name of a pattern basis, see below."""
    patterns_file: Path | None = None
    """NPY file of transmittances (patterns, rows, columns), or a capture; beside this file."""
    interleave: Annotated[Count, Field(le=MAX_INTERLEAVED)] = 1
    """Frames until patterns repeat."""
    common: Annotated[Number, Field(ge=0, le=1)] = 0.5
    """Fraction of the patterns that all frames of a cycle expose."""
    throughput: Throughput | None = None
    """Light that patterns pass; all the same by default."""

    def cycle(self, shape: tuple[int, int]) -> tuple[PatternPlan, ...]:
        """Plans of successive frames, repeated; InputError if there are none."""
        if self.interleave == 1:
            return (self.of_shape(shape),)
        if self.patterns is None:
            raise InputError("interleave needs an order of patterns; an index lists them all")
        shared = max(1, round(self.common * self.patterns))
        patterns = shared + self.interleave * (self.patterns - shared)
        try:
            whole = self.model_copy(update={"patterns": patterns}).of_shape(shape)
        except InputError as error:
            raise InputError(f"interleave {self.interleave}: {error}") from None
        return interleaved(whole, self.interleave, shared)

    def of_shape(self, shape: tuple[int, int]) -> PatternPlan:
        """The plan for patterns of this shape; InputError if there is none."""
        plan = self._exposed(shape)
        return plan if self.throughput is None else self.throughput.of(plan)

    def _exposed(self, shape: tuple[int, int]) -> PatternPlan:
        basis = self._basis(shape)
        if self.index is not None:
            return plan_of_rows(basis, self.index, self.polarity, self.layout or "natural")
        assert isinstance(self.polarity, str)
        return make_plan(shape, self.patterns, self.order, self.polarity, basis)

    def _basis(self, shape: tuple[int, int]) -> Basis:
        kind = BASES[self.basis.partition(":")[0]]
        needs_file = bool(kind.arrays) and not kind.seeded
        if needs_file and self.patterns_file is None:
            raise InputError(f"basis {self.basis} needs patterns_file")
        if self.patterns_file is None:
            return basis_of(self.basis, shape)
        if not needs_file:
            raise InputError(f"basis {self.basis} has no patterns_file")
        check_is_there(self.patterns_file, "patterns_file")
        changed = self.patterns_file.stat().st_mtime_ns
        return _basis_in(self.patterns_file, self.basis, shape, changed)

    @field_validator("patterns_file")
    @classmethod
    def _beside_this_file(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        return path and ((info.context or Path()) / path).absolute()

    @model_validator(mode="after")
    def _rows_are_stated_once(self) -> Plan:
        if self.index is not None and 1 == len(set(self.index)) < len(self.index):
            raise InputError(f"index exposes row {self.index[0]} alone, which makes no image")
        if self.index is None:
            missing = [name for name in ("patterns", "order") if getattr(self, name) is None]
            if missing:
                raise InputError(
                    f"{missing[0]} is missing; a plan has patterns and order, or index"
                )
            if self.layout is not None:
                raise InputError("layout goes with index, which is missing")
            if not isinstance(self.polarity, str):
                raise InputError("a list of polarities goes with index, one for each row")
            return self
        for name in ("patterns", "order"):
            if getattr(self, name) is not None:
                raise InputError(f"index lists all patterns; leave {name} out")
        if not isinstance(self.polarity, str) and len(self.polarity) != len(self.index):
            raise InputError(
                f"polarity has {len(self.polarity)} signs, index {len(self.index)} rows; one for "
                "each is needed"
            )
        return self


@lru_cache(maxsize=4)
def _basis_in(path: Path, name: str, shape: tuple[int, int], changed: int) -> Basis:
    """The basis in a file last modified at `changed`; a plan asks for it repeatedly."""
    if path.suffix == ".npy":
        return BASES[name].restored(shape, {"patterns": read_npy(path, "patterns_file")})
    if path.suffix not in (".h5", ".hdf5"):
        raise InputError(f"patterns_file {path}: allowed are .npy and captures, .h5")
    basis = read_capture(path).plan.patterns
    if basis.name != name:
        raise InputError(f"patterns_file {path}: its patterns are {basis.name}, not {name}")
    return basis


class Filter(Section):
    """The band-pass filter in front of all detectors, with vertical edges."""

    band_nm: tuple[Positive, Positive]
    """[minimum, maximum] wavelength."""
    transmittance: PositiveFraction
    """Transmittance within the band; 0 outside."""


class Lasers(Section):
    """Beams from the projector's pinhole, Gaussian in angle and position."""

    power_w: Positive
    """Power of each: mean of continuous light, peak of a pulse."""
    divergence_mrad: Annotated[Number, Field(ge=0, le=1000)] = 0.0
    """Standard deviation of the angle, per axis."""
    waist_mm: Annotated[Number, Field(ge=0, le=1000)] = 0.0
    """Standard deviation of the exit position, per axis."""
    directions_deg: Annotated[
        tuple[tuple[Angle, Angle], ...], Field(min_length=1, max_length=MAX_SPOTS)
    ]
    """[azimuth to the right, elevation up] of each spot, 1 to 64 spots."""
    steering: AnySteering | None = None
    """Mirrors that turn the spots from these directions, frame by frame; fixed by default."""

    @property
    def directions(self) -> Floats:
        """Unit vectors (spots, 3) in the optical frame, with mirrors at rest."""
        return directions(self.directions_deg)

    @model_validator(mode="after")
    def _different_directions(self) -> Lasers:
        for one, other in combinations(range(len(self.directions_deg)), 2):
            if self.directions_deg[one] == self.directions_deg[other]:
                raise InputError(
                    f"directions_deg: spots {one} and {other} point the same way, "
                    f"{list(self.directions_deg[one])}"
                )
        return self
