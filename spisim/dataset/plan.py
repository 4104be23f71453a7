"""What a data set is to hold: scenes, what varies between samples, how they are recorded."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml
from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from spisim.config import (
    Count,
    Name,
    NonNegative,
    Positive,
    Section,
    find_named,
    parse_model,
    read_text,
)
from spisim.dataset.values import Grid, drawn_value, is_grid, set_field
from spisim.distributions import stream
from spisim.instrument import load_instrument
from spisim.scene import scenes_folder

Seed = Annotated[int, Field(ge=0, lt=2**63)]


class SceneSource(Section):
    """A scene file (or the name of a shipped one), or a family to draw from.

    `parameters` of a family are values, or what to draw them from. There are `distinct` scenes of a
    family; without it every sample has one of its own.
    """

    scene: Name | None = None
    family: Name | None = None
    parameters: dict[Name, Any] = Field(default_factory=dict)
    distinct: Count | None = None
    weight: NonNegative = 1.0

    @model_validator(mode="after")
    def _one_kind(self) -> SceneSource:
        if (self.scene is None) == (self.family is None):
            raise PydanticCustomError("source", "needs either scene or family")
        if self.scene is not None and self.model_fields_set & {"parameters", "distinct"}:
            raise PydanticCustomError("source", "parameters and distinct go with a family")
        return self


class Keep(Section):
    """What is stored with the readings."""

    truth: bool = True
    transport: bool = False  # image and its errors, as OpenEXR beside the capture
    histograms: bool = False  # of the four spots over path length, as NPZ beside the capture


def _open_value(value: Any) -> Any:
    return Grid.model_validate(value) if is_grid(value) else value


class Plan(Section):
    """A data set or study.

    `vary` gives fields of the scene file ("scene.fog.visibility_m") and of the instrument's file
    ("instrument.lasers.power_w") values, distributions, or grids; `materials` does so for materials
    in place of others. With grids, the samples run through all combinations, again and again with
    other random values; within one such round, these are the same. With `every_scene`, the scenes
    are a grid too.
    """

    name: Name
    description: str = ""
    samples: Count | None = None
    seed: Seed = 0
    scenes: Annotated[tuple[SceneSource, ...], Field(min_length=1)]
    every_scene: bool = False
    vary: dict[Name, Annotated[Any, BeforeValidator(_open_value)]] = Field(default_factory=dict)
    materials: dict[Name, Any] = Field(default_factory=dict)
    instrument: Name = "paper"
    spp: Count | None = None
    noise: Positive | None = None
    frames: Count = 1
    keep: Keep = Keep()

    @model_validator(mode="after")
    def _makes_sense(self) -> Plan:
        if self.spp is not None and self.noise is not None:
            raise PydanticCustomError("plan", "needs spp or noise, not both")
        if not sum(source.weight for source in self.scenes) > 0:
            raise PydanticCustomError("plan", "scenes should not all have weight 0")
        for path in self.vary:
            file, dot, field = path.partition(".")
            if file not in ("scene", "instrument") or not dot or not field:
                raise PydanticCustomError(
                    "plan",
                    "vary: {path} should begin with scene. or instrument.",
                    {"path": path},
                )
        return self

    @cached_property
    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Values of every grid, by field."""
        grids = {path: value.grid for path, value in self.vary.items() if isinstance(value, Grid)}
        return ({"scene": tuple(range(len(self.scenes)))} if self.every_scene else {}) | grids

    @property
    def combinations(self) -> int:
        """Of the grids; 1 without any."""
        return math.prod(len(values) for values in self.axes.values())

    @property
    def size(self) -> int:
        """Number of samples; without one, each combination of the grids once."""
        return self.combinations if self.samples is None else self.samples

    @property
    def effort(self) -> dict[str, Any]:
        """Arguments of `simulate` that say how long to trace light."""
        if self.spp is not None:
            return {"spp": self.spp}
        return {"transport_noise": 0.01 if self.noise is None else self.noise}


@dataclass(frozen=True)
class Sample:
    """One sample of a plan, ready to be simulated, and what was drawn for it."""

    index: int
    seed: int
    scene_name: str  # equal for samples of one and the same scene
    scene_text: str
    scene_folder: Path
    instrument_text: str
    parameters: Mapping[str, Any]  # by field of the plan


@dataclass(frozen=True)
class PlannedSet:
    """A plan, where it lies, and its text."""

    plan: Plan
    text: str
    folder: Path

    @property
    def digest(self) -> str:
        """SHA-256 of what the samples depend on: all of the plan but their number."""
        fields = yaml.safe_load(self.text)
        fields.pop("samples", None)
        return hashlib.sha256(yaml.safe_dump(fields).encode()).hexdigest()

    def sample(self, index: int) -> Sample:
        """Sample of this index; depends on plan and index alone.

        Raises InputError for values that cannot be drawn, or fields that are none.
        """
        plan, seed = self.plan, self.plan.seed
        round_, place = divmod(index, plan.combinations)
        chosen = dict(zip(plan.axes, self._combination(place), strict=True))
        values = {
            path: chosen[path] if path in chosen else drawn_value(value, seed, path, round_)
            for path, value in plan.vary.items()
        }
        source = self._source(round_, chosen)
        fields, folder, parameters = self._scene(source, round_)
        swaps = {
            old: drawn_value(new, seed, f"materials.{old}", round_)
            for old, new in plan.materials.items()
        }
        if swaps:
            fields["material_swaps"] = {**fields.get("material_swaps", {}), **swaps}
        instrument = self._instrument()
        for path, value in values.items():
            file, _, field = path.partition(".")
            set_field(fields if file == "scene" else instrument, field, value)
        name = fields.get("name") or f"{source.family}-{fields['seed']}"
        return Sample(
            index,
            int(stream(seed, "capture", index).integers(2**62)),
            name,
            _dump(fields),
            folder,
            _dump(instrument),
            {
                "scene": source.family or name,
                **parameters,
                **values,
                **{f"materials.{old}": new for old, new in swaps.items()},
            },
        )

    def _combination(self, place: int) -> tuple[Any, ...]:
        return next(itertools.islice(itertools.product(*self.plan.axes.values()), place, None))

    def _source(self, round_: int, chosen: Mapping[str, Any]) -> SceneSource:
        sources = self.plan.scenes
        if "scene" in chosen:
            return sources[chosen["scene"]]
        weights = np.array([source.weight for source in sources])
        rng = stream(self.plan.seed, "scene", round_)
        return sources[int(rng.choice(len(sources), p=weights / weights.sum()))]

    def _scene(
        self, source: SceneSource, round_: int
    ) -> tuple[dict[str, Any], Path, dict[str, Any]]:
        """Fields of the scene file, folder of its meshes, and the parameters of a family."""
        if source.scene is not None:
            file = find_named(self._beside(source.scene), scenes_folder(), "scene")
            return yaml.safe_load(read_text(file)), file.parent, {}
        assert source.family is not None  # the source demands one of the two
        rng = stream(self.plan.seed, "family", source.family, round_)
        seed = int(rng.integers(2**31 if source.distinct is None else source.distinct))
        # Distinct scenes come again with their parameters: those follow from the scene's seed.
        key = ("round", round_) if source.distinct is None else ("distinct", seed)
        parameters = {
            name: drawn_value(value, self.plan.seed, f"parameters.{name}", *key)
            for name, value in source.parameters.items()
        }
        fields = {"family": source.family, "seed": seed, "parameters": parameters}
        told = {f"parameters.{name}": value for name, value in parameters.items()}
        return fields, self.folder, {"family_seed": seed, **told}

    def _instrument(self) -> dict[str, Any]:
        text = load_instrument(self._beside(self.plan.instrument)).text
        fields: dict[str, Any] = yaml.safe_load(text)
        return fields

    def _beside(self, name: str) -> str:
        """A file by its path from the plan, if there is one; else the name as it stands."""
        beside = self.folder / name
        return str(beside) if beside.is_file() else name


def load_plan(path: Path) -> PlannedSet:
    """Plan from a YAML file; InputError, naming file and field, for whatever is wrong with it."""
    text = read_text(path)
    return PlannedSet(parse_model(text, Plan, path), text, path.parent)


def _dump(fields: Mapping[str, Any]) -> str:
    kept = {name: value for name, value in fields.items() if value is not None}
    return yaml.safe_dump(kept, sort_keys=False, allow_unicode=True)
