"""What a data set is to hold: scenes, what varies between samples, how they are recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from numbers import Real
from typing import Annotated, Any

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
from spisim.dataset.values import (
    Grid,
    open_value,
    openable,
    possible,
)
from spisim.scene.families import FAMILIES

#: A run holds the indices of all samples that it is to make.
MAX_SAMPLES = 10**7
#: Seeds of scenes are below this.
SCENE_SEEDS = 2**31

Seed = Annotated[int, BeforeValidator(not_a_truth_value), Field(ge=0, lt=2**63)]
Drawn = Annotated[Any, BeforeValidator(open_value)]
Openable = Annotated[Any, BeforeValidator(openable)]


def _instruments(value: Any) -> Any:
    """A name, or a grid of names."""
    names = openable(value)
    for name in names.grid if isinstance(names, Grid) else (names,):
        if not isinstance(name, str) or not name:
            raise PydanticCustomError("instrument", "should be a name, or a grid of names")
    return names


def _wavelengths(value: Any) -> Any:
    """A wavelength, a distribution of them, or a grid; or None."""
    open_ = openable(value)
    for each in [] if value is None else possible(open_):
        if not is_distribution(each) and (isinstance(each, bool) or not isinstance(each, Real)):
            result = "" if each is value else f", not {show(each)}"
            raise PydanticCustomError("wavelength", "should be a number{found}", {"found": result})
    return open_


class SceneSource(Section):
    """A scene file (or the name of a shipped one), or a family to draw from.

    `parameters` of a family are values, or what to draw them from. There are `distinct` scenes of a
    family; without it every sample has one of its own.
    """

    scene: Name | None = None
    """A shipped scene by its name, or a file beside the plan. This or `family`."""
    family: Name | None = None
    """A family to draw from. This or `scene`."""
    parameters: dict[Name, Drawn] = Field(default_factory=dict)
    """The family's own: values, or what they are drawn from."""
    distinct: Annotated[Count, Field(le=SCENE_SEEDS)] | None = None
    """How many scenes of the family there are, which come again; one for each sample without."""
    weight: NonNegative = 1.0
    """How often, next to the weights of the others."""

    @model_validator(mode="after")
    def _one_kind(self) -> SceneSource:
        if (self.scene is None) == (self.family is None):
            raise PydanticCustomError("source", "needs either scene or family")
        if self.scene is not None and self.model_fields_set & {"parameters", "distinct"}:
            raise PydanticCustomError("source", "parameters and distinct go with a family")
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


#: Error of the light next to the detectors' noise where a plan does not tell: 4 % more noise.
NOISE_SHARE = 0.3


class Keep(Section):
    """What is stored with the readings."""

    truth: bool = True
    """What is true of each frame, which evaluation needs."""
    transport: bool = False
    """The transport image and its errors, as OpenEXR beside the capture."""
    histograms: bool = False
    """The four spots' light over path length, as NPZ beside the capture."""


class Plan(Section):
    """A data set or study.

    `vary` gives fields of the scene file ("scene.fog.visibility_m") and of the instrument's file
    ("instrument.lasers.power_w") values, distributions, or grids; under any other name, mappings of
    such fields, which change together. `materials` does so for materials in place of others, and
    `wavelength_nm` for the wavelength that the instrument is built for; the scene follows. With
    grids, the samples run through all combinations, again and again with other random values;
    within one such round, these are the same. With `every_scene`, the scenes are a grid too.
    `light` is "traced", or a fast "surrogate" for sets to learn from.
    `poses`, a number or a section, sees each scene from several poses, in as many rounds, one after
    the other; scenes, wavelength and materials stay the same in them, the rest is drawn anew.
    """

    name: Name
    """Of the data set."""
    description: str = ""
    """What it is for, in words."""
    samples: Annotated[Count, Field(le=MAX_SAMPLES)] | None = None
    """How many; each combination of the grids once without."""
    seed: Seed = 0
    """Of all that is random."""
    scenes: Annotated[tuple[SceneSource, ...], Field(min_length=1)]
    """Scene files and families; which one a sample has is drawn by their weights."""
    every_scene: bool = False
    """Whether the scenes are a grid, each made with every combination of the others."""
    poses: AnyPoses = Poses()
    """How many poses each scene is seen from, or a section that also says how far apart."""
    vary: dict[Name, Openable] = Field(default_factory=dict)
    """Fields of scene and instrument, `scene.…` and `instrument.…`, or bundles of them."""
    materials: dict[Name, Openable] = Field(default_factory=dict)
    """Materials in place of those of these names, in all scenes that have them."""
    instrument: Annotated[Any, BeforeValidator(_instruments)] = "paper"
    """A preset or a file beside the plan, or a grid of them."""
    wavelength_nm: Annotated[Any, BeforeValidator(_wavelengths)] = None
    """What the instrument is built for: a number, a distribution or a grid. Scenes follow."""
    light: LightSource = "traced"
    """Traced, or a fast stand-in."""
    spp: Annotated[Count, Field(le=2**20)] | None = None
    """Light paths per virtual pixel and strategy. This or `transport_noise_share`."""
    transport_noise_share: Annotated[Number, Field(ge=1e-3, le=10)] | None = None
    """Error of the light, as a share of the detectors' noise; 0.3 without `spp`."""
    frames: Count = 1
    """Frames of every capture."""
    keep: Keep = Keep()
    """What is stored with the readings."""

    @model_validator(mode="before")
    @classmethod
    def _error_next_to_noise(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "transport_error" in data:
            raise PydanticCustomError(
                "plan",
                "transport_error is told as transport_noise_share, the light's standard error as a "
                "share of the detectors' noise (usual, {usual}), or as spp",
                {"usual": NOISE_SHARE},
            )
        return data

    @model_validator(mode="after")
    def _makes_sense(self) -> Plan:
        if self.spp is not None and self.transport_noise_share is not None:
            raise PydanticCustomError("plan", "needs spp or transport_noise_share, not both")
        if self.light == "surrogate" and (self.spp or self.transport_noise_share):
            raise PydanticCustomError(
                "plan", "light: surrogate is not traced; take out spp and transport_noise_share"
            )
        if not 0 < sum(source.weight for source in self.scenes) < math.inf:
            raise PydanticCustomError(
                "plan", "scenes should not all have weight 0, and their weights a finite sum"
            )
        if self.every_scene and not all(source.weight for source in self.scenes):
            raise PydanticCustomError(
                "plan", "every_scene makes scenes of weight 0 too; take them out"
            )
        if self.size > MAX_SAMPLES:
            raise PydanticCustomError(
                "plan",
                "the grids have {size} combinations; at most {most} can be made",
                {"size": self.size, "most": MAX_SAMPLES},
            )
        paths = list(self.vary)
        for number, path in enumerate(paths):
            _check_path(path, self.vary[path], paths[:number])
        return self

    @property
    def open(self) -> dict[str, Any]:
        """What every sample draws, by field: `vary`, and `materials` as "materials.old"."""
        moved = {} if self.wavelength_nm is None else {"wavelength_nm": self.wavelength_nm}
        swaps = {f"materials.{old}": new for old, new in self.materials.items()}
        return {**moved, **self.vary, **swaps}

    @cached_property
    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Values of every grid, by field."""
        values = {"instrument": self.instrument, **self.open}
        grids = {path: value.grid for path, value in values.items() if isinstance(value, Grid)}
        return ({"scene": tuple(range(len(self.scenes)))} if self.every_scene else {}) | grids

    @property
    def instruments(self) -> tuple[str, ...]:
        """Names or files of all instruments."""
        return self.axes.get("instrument", (self.instrument,))

    @property
    def combinations(self) -> int:
        """Of the grids; 1 without any."""
        return math.prod(len(values) for values in self.axes.values())

    @property
    def size(self) -> int:
        """Number of samples; without one, each combination of the grids once."""
        return self.combinations if self.samples is None else self.samples

    @property
    def sampling_budget(self) -> dict[str, Any]:
        """Arguments of `simulate` that say how long to trace light, or not to."""
        if self.light == "surrogate":
            return {"light": "surrogate"}
        if self.spp is not None:
            return {"spp": self.spp}
        fraction = self.transport_noise_share
        return {"transport_noise_share": NOISE_SHARE if fraction is None else fraction}


def _check_path(path: str, value: Any, before: list[str]) -> None:
    """Fields are set in the order given: a section after one of its fields would erase it."""
    if not is_field(path) and not all(
        isinstance(fields, Mapping) and all(map(is_field, fields)) for fields in possible(value)
    ):
        raise PydanticCustomError(
            "plan",
            "vary: {path} should begin with scene. or instrument., or each of its values be a "
            "mapping of such fields",
            {"path": path},
        )
    for other in before:
        if other.startswith(f"{path}."):
            raise PydanticCustomError(
                "plan",
                "vary: {path} should stand before {other}, which it would replace",
                {"path": path, "other": other},
            )


def is_field(path: Any) -> bool:
    """Whether this names a field of the scene's or the instrument's file."""
    file, _, field = str(path).partition(".")
    return file in ("scene", "instrument") and bool(field)
