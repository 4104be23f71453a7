"""The plan of a design: scenes, weathers, what may be chosen, and what for."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml
from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.base.errors import InputError, naming, nearest
from spisim.base.config import (
    Count,
    Name,
    Positive,
    Section,
    find_named,
    is_file,
    load_yaml,
    parse_model,
    read_text,
)
from spisim.dataset.plan import Seed
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.model import PRESETS
from spisim.scene import scenes_folder
from spisim.scene.families import FAMILIES
from spisim_inverse.design.objectives import OBJECTIVES

LATER = ("description", "at_most", "evaluations", "judgement")
"""Fields of a plan that change no figure of its search."""
MAX_COMPONENTS = 64
"""Maximum numbers that a search changes together."""


def _objective(name: Any) -> Any:
    if isinstance(name, str) and name not in OBJECTIVES:
        raise InputError(f"unknown objective {name!r}: {nearest(name, OBJECTIVES)}")
    return name


class Source(Section):
    """A scene file, the name of a shipped scene, or a family to draw scenes from."""

    scene: Name | None = None
    """A shipped scene by name, or a file beside the plan. Either this or `family`."""
    family: Name | None = None
    """A family to draw scenes from. Either this or `scene`."""
    parameters: dict[Name, Any] = Field(default_factory=dict)
    """Parameters of the family that are not drawn."""
    count: Annotated[Count, Field(le=1000)] = 1
    """Number of scenes of the family."""

    @model_validator(mode="after")
    def _one_kind(self) -> Source:
        if (self.scene is None) == (self.family is None):
            raise PydanticCustomError("source", "should have either scene or family")
        if self.scene is not None and self.model_fields_set & {"parameters", "count"}:
            raise PydanticCustomError("source", "parameters and count are only for a family")
        if self.family is not None:
            allowed = FAMILIES[self.family].parameters.model_fields
            for name in self.parameters:
                if name not in allowed:
                    raise InputError(
                        f"unknown parameter {name!r} of {self.family}: {nearest(name, allowed)}"
                    )
        return self

    @property
    def world(self) -> str:
        """The family or scene."""
        return self.family or str(self.scene)


class Allowed(Section):
    """Allowed values of a parameter: a list of `values`, or all from `low` to `high`.

    `low` and `high` have the shape of the field, a number or lists of numbers.
    """

    values: Annotated[tuple[Any, ...], Field(min_length=2)] | None = None
    """The values; in a bundle, mappings of fields. Either these, or `low` and `high`."""
    low: Any = None
    """Lower ends."""
    high: Any = None
    """Upper ends."""
    step: Positive | None = None
    """Values are multiples of this."""

    @model_validator(mode="after")
    def _one_kind(self) -> Allowed:
        ends = self.low is not None, self.high is not None
        if (self.values is None) != all(ends) or (self.values is not None and any(ends)):
            raise PydanticCustomError("allowed", "should have either values, or low and high")
        if self.values is None:
            self._check_ends()
        elif self.step is not None:
            raise PydanticCustomError("allowed", "step is only for low and high")
        return self

    def _check_ends(self) -> None:
        low, high = (_numbers(name, getattr(self, name)) for name in ("low", "high"))
        if low.shape != high.shape:
            raise InputError(f"low has the shape {low.shape}, high {high.shape}; they should agree")
        for below, above in zip(low.ravel(), high.ravel(), strict=True):
            if not below <= above:
                raise InputError(f"low {below:g} is above high {above:g}: exchange them")
        if not (low < high).any():
            raise InputError("low and high are equal: there is nothing to choose")
        if low.size > MAX_COMPONENTS:
            raise InputError(f"has {low.size} numbers; at most {MAX_COMPONENTS}")

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Lower and upper ends as arrays; None for a list of values."""
        if self.values is not None:
            return None
        return _numbers("low", self.low), _numbers("high", self.high)


def _numbers(name: str, value: Any) -> np.ndarray:
    try:
        if isinstance(value, bool | str):
            raise TypeError
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(
            f"{name} should be a number or a list of numbers; found {value!r}"
        ) from None
    if not np.isfinite(numbers).all():
        raise InputError(f"{name} should be finite; found {value!r}")
    return numbers


class DesignPlan(Section):
    """Which instrument measures best over scenes and weathers, within the limits of a base.

    `choose` maps fields of the instrument file ("lasers.directions_deg") to their allowed values.
    `tof.times` are relative times of the modulation frequencies, `laser_fraction` is the fraction
    of the emitted power that the lasers have. A name without a dot is a bundle, whose values are
    mappings of fields that change together. Every instrument keeps total power, frame time, laser
    class, risk group and lens diameters of the base or stays below. Scenes of `search` and
    `judgement` share no family and no file.
    """

    name: Name
    """Name of the design."""
    description: str = ""
    """Its purpose."""
    seed: Seed = 0
    """Seed of scenes, noise and search."""
    instrument: Name = "fog"
    """The base: a preset, or a file beside the plan."""
    search: Annotated[tuple[Source, ...], Field(min_length=1)]
    """Scenes that the search measures in."""
    judgement: Annotated[tuple[Source, ...], Field(min_length=1)]
    """Scenes that base and chosen instrument are compared in."""
    weathers: Annotated[dict[Name, dict[Name, Any]], Field(min_length=1)]
    """Sections of a scene file by name of the weather; those not given keep clear air."""
    choose: Annotated[dict[Name, Allowed], Field(min_length=1)]
    """What may be chosen."""
    objectives: Annotated[
        tuple[Annotated[Name, BeforeValidator(_objective)], ...], Field(min_length=1)
    ]
    """What is to be small, over all weathers equally."""
    at_most: dict[Annotated[Name, BeforeValidator(_objective)], Positive] = Field(
        default_factory=dict
    )
    """Limits of objectives, over those of the base: 1 for those that nothing may be lost in."""
    evaluations: Annotated[Count, Field(le=10**6)] = 200
    """Instruments that the search simulates."""
    draws: Annotated[Count, Field(le=1000)] = 2
    """Frames of each scene, with noise of their own."""
    spp: Annotated[Count, Field(le=2**16)] = 16
    """Light paths per virtual pixel; spots have more."""
    max_range_m: Positive | None = None
    """Farther spots do not count; the unambiguous range of the base by default."""
    max_aperture_mm: Positive | None = None
    """Diameter of the largest lens; that of the base by default."""

    @model_validator(mode="after")
    def _makes_sense(self) -> DesignPlan:
        for what, names in (
            ("objectives", self.objectives),
            ("search", [source.world for source in self.search]),
            ("judgement", [source.world for source in self.judgement]),
        ):
            if twice := [name for name in names if list(names).count(name) > 1]:
                raise InputError(f"{what}: {twice[0]} is repeated")
        for name in self.at_most:
            if name not in self.objectives:
                raise InputError(f"at_most: {name} is not among the objectives")
        seen = {source.world for source in self.search}
        if both := [source.world for source in self.judgement if source.world in seen]:
            raise InputError(
                f"judgement: {both[0]} is also in search; what is judged should be unseen"
            )
        for weather, sections in self.weathers.items():
            for name in sections:
                if name not in WEATHER_SECTIONS:
                    raise InputError(
                        f"weathers.{weather}: unknown section {name!r}: "
                        f"{nearest(name, WEATHER_SECTIONS)}"
                    )
        return self


WEATHER_SECTIONS = ("fog", "rain", "snow", "smoke", "ambient")
"""Sections of a scene file that a weather may set."""


@dataclass(frozen=True)
class PlannedDesign:
    """A plan, its text, and its file."""

    plan: DesignPlan
    text: str
    path: Path

    @cached_property
    def instrument(self) -> Instrument:
        """The base."""
        with naming(self.path):
            return load_instrument(self._beside(self.plan.instrument, PRESETS, "instrument"))

    def scene_file(self, name: str) -> Path:
        """File of a scene."""
        with naming(self.path):
            return self._beside(name, scenes_folder(), "scene")

    @cached_property
    def fields(self) -> dict[str, Any]:
        """The fields of the file."""
        fields: dict[str, Any] = load_yaml(self.text, self.path)
        return fields

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all that figures of the search depend on."""
        fields = {name: value for name, value in self.fields.items() if name not in LATER}
        names = [source.scene for source in self.plan.search]
        texts = [read_text(self.scene_file(name)) for name in names if name]
        content = yaml.safe_dump([fields, self.instrument.text, texts], sort_keys=False)
        return hashlib.sha256(content.encode()).hexdigest()

    def _beside(self, name: str, folder: Path, kind: str) -> Path:
        beside = self.path.parent / name
        return find_named(str(beside) if is_file(beside) else name, folder, kind)


def load_design(path: str | Path) -> PlannedDesign:
    """Read a plan.

    Raises
    ------
    InputError
        For an invalid plan, naming file, field, value and what is allowed.
    """
    file = Path(path)
    text = read_text(file)
    return PlannedDesign(parse_model(text, DesignPlan, file), text, file.absolute())


def weather_of(plan: DesignPlan, name: str) -> Mapping[str, Any]:
    """Sections of a scene file that make a weather; None removes one."""
    cleared = {section: None for section in WEATHER_SECTIONS if section != "ambient"}
    return {**cleared, **plan.weathers[name]}
