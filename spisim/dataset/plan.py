"""Plan of a data set: scenes, what varies between samples, and how they are recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from numbers import Real
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.base.errors import InputError, nearest
from spisim.base.config import (
    Count,
    LightSource,
    Name,
    NonNegative,
    Number,
    Section,
    not_a_truth_value,
)
from spisim.base.config.distributions import is_distribution
from spisim.base.config.messages import show
from spisim.dataset.poses import AnyPoses, Poses
from spisim.dataset.values import Grid, open_value, openable, possible
from spisim.scene.families import FAMILIES

#: A run holds the indices of all its samples in memory.
MAX_SAMPLES = 10**7
#: Upper bound of scene seeds.
SCENE_SEEDS = 2**31

Seed = Annotated[int, BeforeValidator(not_a_truth_value), Field(ge=0, lt=2**63)]
Drawn = Annotated[Any, BeforeValidator(open_value)]
Openable = Annotated[Any, BeforeValidator(openable)]


def _instruments(value: Any) -> Any:
    """Validate a name or a grid of names."""
    names = openable(value)
    for name in names.grid if isinstance(names, Grid) else (names,):
        if not isinstance(name, str) or not name:
            raise PydanticCustomError("instrument", "should be a name, or a grid of names")
    return names


def _wavelengths(value: Any) -> Any:
    """Validate a wavelength, a distribution, a grid, or None."""
    open_ = openable(value)
    for each in [] if value is None else possible(open_):
        if not is_distribution(each) and (isinstance(each, bool) or not isinstance(each, Real)):
            suffix = "" if each is value else f", not {show(each)}"
            raise PydanticCustomError(
                "wavelength", "should be a number{suffix}", {"suffix": suffix}
            )
    return open_


class SceneSource(Section):
    """A scene file, the name of a shipped scene, or a family to draw scenes from.

    `parameters` of a family are values or distributions. A family has `distinct` different scenes;
    without it, every sample has its own.
    """

    scene: Name | None = None
    """A shipped scene by name, or a file beside the plan. Either this or `family`."""
    family: Name | None = None
    """A family to draw scenes from. Either this or `scene`."""
    parameters: dict[Name, Drawn] = Field(default_factory=dict)
    """Parameters of the family: values or distributions."""
    distinct: Annotated[Count, Field(le=SCENE_SEEDS)] | None = None
    """Number of different scenes of the family, which recur; without it, one for each sample."""
    weight: NonNegative = 1.0
    """Relative frequency among the scenes."""

    @model_validator(mode="after")
    def _one_kind(self) -> SceneSource:
        if (self.scene is None) == (self.family is None):
            raise PydanticCustomError("source", "should have either scene or family")
        if self.scene is not None and self.model_fields_set & {"parameters", "distinct"}:
            raise PydanticCustomError("source", "parameters and distinct are only for a family")
        if self.family is not None:
            self._check_parameters(self.family)
        return self

    def _check_parameters(self, family: str) -> None:
        given = FAMILIES[family].parameters.model_fields
        for name in self.parameters:
            if name not in given:
                raise InputError(
                    f"unknown parameter {show(name)} of {family}: {nearest(name, given)}"
                )


#: Default standard error of the light relative to the detectors' noise, which adds 4 % of noise.
NOISE_SHARE = 0.3


class Keep(Section):
    """What is stored with the readings."""

    truth: bool = True
    """Ground truth of each frame, which evaluation needs."""
    transport: bool = False
    """The transport image and its errors, as OpenEXR beside the capture."""
    histograms: bool = False
    """The light of the spots over path length, as NPZ beside the capture."""


class Plan(Section):
    """A data set or study.

    `vary` maps fields of the scene file ("scene.fog.visibility_m") and of the instrument file
    ("instrument.lasers.power_w") to values, distributions or grids. Under any other name it holds
    bundles: mappings of such fields that change together. `materials` likewise replaces materials,
    and `wavelength_nm` sets the instrument's wavelength, which the scene follows. With grids, the
    samples run through all combinations again and again, each round with new random values. With
    `every_scene`, the scenes are a grid too. `light` is "traced", or a fast "surrogate" for
    training sets. `poses`, a number or a section, shows each scene from several poses in as many
    consecutive rounds. Scene, wavelength and materials stay the same within them; everything else
    is drawn anew.
    """

    name: Name
    """Name of the data set."""
    description: str = ""
    """Its purpose."""
    samples: Annotated[Count, Field(le=MAX_SAMPLES)] | None = None
    """Number of samples; without it, each combination of the grids once."""
    seed: Seed = 0
    """Seed of all random values."""
    scenes: Annotated[tuple[SceneSource, ...], Field(min_length=1)]
    """Scene files and families, drawn by their weights."""
    every_scene: bool = False
    """Whether the scenes are a grid, combined with all values of other grids."""
    poses: AnyPoses = Poses()
    """Number of poses per scene, or a section that also gives their distances."""
    vary: dict[Name, Openable] = Field(default_factory=dict)
    """Fields of scene and instrument, `scene.…` and `instrument.…`, or bundles of them."""
    materials: dict[Name, Openable] = Field(default_factory=dict)
    """Replacements of materials, by the names of those replaced in all scenes."""
    instrument: Annotated[Any, BeforeValidator(_instruments)] = "paper"
    """A preset, a file beside the plan, or a grid of them."""
    wavelength_nm: Annotated[Any, BeforeValidator(_wavelengths)] = None
    """Wavelength of the instrument: a number, a distribution or a grid. Scenes follow."""
    light: LightSource = "traced"
    """Traced, or a fast surrogate."""
    spp: Annotated[Count, Field(le=2**20)] | None = None
    """Light paths per virtual pixel and strategy. Either this or `transport_noise_share`."""
    transport_noise_share: Annotated[Number, Field(ge=1e-3, le=10)] | None = None
    """Standard error of the light as a fraction of the detectors' noise; 0.3 without `spp`."""
    frames: Count | Literal["flight"] = 1
    """Frames per capture; `flight` for all of a flight of `poses.flight_s`, with their poses."""
    keep: Keep = Keep()
    """What is stored with the readings."""

    @model_validator(mode="before")
    @classmethod
    def _error_next_to_noise(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "transport_error" in data:
            raise PydanticCustomError(
                "plan",
                "transport_error was replaced by transport_noise_share, the light's standard error "
                "as a fraction of the detectors' noise (default {usual}), or by spp",
                {"usual": NOISE_SHARE},
            )
        return data

    @model_validator(mode="after")
    def _makes_sense(self) -> Plan:
        if self.spp is not None and self.transport_noise_share is not None:
            raise PydanticCustomError("plan", "should have spp or transport_noise_share, not both")
        if self.light == "surrogate" and (self.spp or self.transport_noise_share):
            raise PydanticCustomError(
                "plan", "light: surrogate is not traced; remove spp and transport_noise_share"
            )
        if problem := self._flight_problem:
            raise PydanticCustomError("plan", problem)
        if not 0 < sum(source.weight for source in self.scenes) < math.inf:
            raise PydanticCustomError(
                "plan", "the weights of scenes should have a finite sum above 0"
            )
        if self.every_scene and not all(source.weight for source in self.scenes):
            raise PydanticCustomError(
                "plan", "every_scene includes scenes of weight 0; remove them"
            )
        if self.size > MAX_SAMPLES:
            raise PydanticCustomError(
                "plan",
                "the plan has {size} samples; at most {maximum} are allowed",
                {"size": self.size, "maximum": MAX_SAMPLES},
            )
        paths = list(self.vary)
        for number, path in enumerate(paths):
            _check_path(path, self.vary[path], paths[:number])
        return self

    @property
    def _flight_problem(self) -> str | None:
        """Why poses, frames and what is kept do not fit a flight; None if they do."""
        poses = self.poses
        if self.frames != "flight":
            few = poses.flight_s is not None and poses.count < 2
            return f"poses.count: {poses.count}; a flight needs at least 2 poses" if few else None
        if poses.flight_s is None or poses.count != 1:
            return "frames: flight needs poses with flight_s, and a count of 1"
        if self.keep.transport or self.keep.histograms:
            return "frames: flight keeps neither transport nor histograms; remove them"
        return None

    @property
    def open(self) -> dict[str, Any]:
        """Fields that samples draw: `vary`, and `materials` as "materials.NAME"."""
        moved = {} if self.wavelength_nm is None else {"wavelength_nm": self.wavelength_nm}
        swaps = {f"materials.{old}": new for old, new in self.materials.items()}
        return {**moved, **self.vary, **swaps}

    @cached_property
    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Values of every grid by field."""
        values = {"instrument": self.instrument, **self.open}
        grids = {path: value.grid for path, value in values.items() if isinstance(value, Grid)}
        return ({"scene": tuple(range(len(self.scenes)))} if self.every_scene else {}) | grids

    @property
    def instruments(self) -> tuple[str, ...]:
        """Names or files of all instruments."""
        return self.axes.get("instrument", (self.instrument,))

    @property
    def combinations(self) -> int:
        """Number of combinations of the grids; 1 without grids."""
        return math.prod(len(values) for values in self.axes.values())

    @property
    def size(self) -> int:
        """Number of samples; by default each combination of the grids once."""
        return self.combinations if self.samples is None else self.samples

    @property
    def sampling_budget(self) -> dict[str, Any]:
        """Arguments of `simulate` that set the source and the accuracy of light."""
        if self.light == "surrogate":
            return {"light": "surrogate"}
        if self.spp is not None:
            return {"spp": self.spp}
        fraction = self.transport_noise_share
        return {"transport_noise_share": NOISE_SHARE if fraction is None else fraction}


def _check_path(path: str, value: Any, before: list[str]) -> None:
    """Check a field of `vary`; fields are set in order, so a section must precede its fields."""
    if not is_field(path) and not all(
        isinstance(fields, Mapping) and all(map(is_field, fields)) for fields in possible(value)
    ):
        raise PydanticCustomError(
            "plan",
            "vary: {path} should begin with scene. or instrument., or have mappings of such fields "
            "as values",
            {"path": path},
        )
    for other in before:
        if other.startswith(f"{path}."):
            raise PydanticCustomError(
                "plan",
                "vary: {path} should precede {other}, which it would overwrite",
                {"path": path, "other": other},
            )


def is_field(path: Any) -> bool:
    """Return whether a path names a field of the scene file or the instrument file."""
    file, _, field = str(path).partition(".")
    return file in ("scene", "instrument") and bool(field)
