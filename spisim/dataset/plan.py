"""What a data set is to hold: scenes, what varies between samples, how they are recorded."""

from __future__ import annotations

import copy
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import yaml
from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.errors import InputError, naming, nearest
from spisim.config import (
    Count,
    LightSource,
    Name,
    NonNegative,
    Number,
    Section,
    dump_yaml,
    find_named,
    is_file,
    load_yaml,
    not_a_truth_value,
    parse_model,
    read_mapping,
    read_text,
)
from spisim.config.distributions import is_distribution, stream
from spisim.config.messages import show
from spisim.dataset.poses import AnyPoses, Poses, View
from spisim.dataset.values import (
    Grid,
    drawn_value,
    open_value,
    openable,
    possible,
    section_of,
    set_field,
)
from spisim.instrument import Instrument
from spisim.instrument.load import PRESETS
from spisim.scene import scenes_folder
from spisim.scene.description import SceneDescription
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
            found = "" if each is value else f", not {show(each)}"
            raise PydanticCustomError("wavelength", "should be a number{found}", {"found": found})
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
        known = FAMILIES[family].parameters.model_fields
        for name in self.parameters:
            if name not in known:
                raise InputError(
                    f"unknown parameter {show(name)} of {family}: {nearest(name, known)}"
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
        share = self.transport_noise_share
        return {"transport_noise_share": NOISE_SHARE if share is None else share}


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


@dataclass(frozen=True)
class Sample:
    """One sample of a plan, ready to be simulated, and what was drawn for it."""

    index: int
    seed: int
    scene_name: str  # equal for samples of one and the same scene
    scene_text: str
    scene_folder: Path
    instrument_text: str
    instrument_folder: Path
    wavelength_nm: float | None  # that the instrument is moved to
    view: View
    parameters: Mapping[str, Any]  # by field of the plan


@dataclass(frozen=True)
class PlannedSet:
    """A plan, its text, and the file it stands in."""

    plan: Plan
    text: str
    path: Path

    @cached_property
    def fields(self) -> dict[str, Any]:
        """The plan as it was written, but for the number of samples."""
        fields: dict[str, Any] = load_yaml(self.text, self.path)
        return {name: value for name, value in fields.items() if name != "samples"}

    @cached_property
    def files(self) -> dict[str, dict[str, Any]]:
        """What stands in the files that the plan names, by those names, as read the first time.

        Raises InputError where one is missing or no YAML.
        """
        with naming(self.path):
            files = {}
            for name in sorted({source.scene for source in self.plan.scenes if source.scene}):
                file = self._scene_file(name)
                files[f"scene {name}"] = read_mapping(read_text(file), SceneDescription, file)
            for name in sorted(set(self.plan.instruments)):
                file = self._instrument_file(name)
                files[f"instrument {name}"] = read_mapping(read_text(file), Instrument, file)
            return files

    @cached_property
    def digest(self) -> str:
        """SHA-256 of what the samples depend on: the plan but for their number, and its files."""
        content = [self.fields, order_of(self.fields), self.files]
        return hashlib.sha256(yaml.safe_dump(content).encode()).hexdigest()

    def with_samples(self, samples: int) -> PlannedSet:
        """The same plan with another number of samples; its text loses its comments."""
        text = dump_yaml({**self.fields, "samples": samples})
        return replace(self, plan=self.plan.model_copy(update={"samples": samples}), text=text)

    def sample(self, index: int) -> Sample:
        """Sample of this index; depends on plan, its files and index alone.

        Raises InputError, naming the plan, for fields that are none.
        """
        plan, seed = self.plan, self.plan.seed
        round_, chosen = self._place(index)
        scene_round, number = divmod(round_, plan.poses.count)
        source = plan.scenes[self.source_of(index)]
        drawn: dict[str, Any] = {}
        for path, open_ in plan.open.items():
            of_scene = path == "wavelength_nm" or path.startswith("materials.")
            key = scene_round if of_scene else round_
            value = drawn_value(chosen.get(path, open_), seed, path, key)
            together = path in plan.vary and not is_field(path)
            drawn |= value if together else {path: value}
        instrument = chosen.get("instrument", plan.instrument)
        scene, folder, parameters = self._scene(source, scene_round)
        files = {
            "scene": scene,
            "instrument": copy.deepcopy(self.files[f"instrument {instrument}"]),
        }
        with naming(self.path):
            for path, value in drawn.items():
                file, _, field = path.partition(".")
                if file in files:
                    set_field(files[file], field, copy.deepcopy(value))  # fields of it may follow
                elif file == "materials":
                    section_of(scene, "material_swaps", path)[field] = value
        name = scene.get("name") or _name_drawn(scene) or str(source.scene)
        told: dict[str, Any] = {"instrument": instrument} if "instrument" in chosen else {}
        if plan.poses.count > 1:
            told["pose"] = number
        return Sample(
            index,
            int(stream(seed, "capture", index).integers(2**62)),
            name,
            _dump(scene),
            folder,
            _dump(files["instrument"]),
            self._instrument_file(instrument).parent,
            drawn.get("wavelength_nm"),
            View(number, plan.poses, self._pose_seed(round_)),
            {"scene": source.family or name, **told, **parameters, **drawn},
        )

    def _pose_seed(self, round_: int) -> int:
        """Of a pose of its own, or of the flight of a scene."""
        poses, seed = self.plan.poses, self.plan.seed
        if poses.flight_s is None:
            return int(stream(seed, "pose", round_).integers(2**62))
        return int(stream(seed, "flight", round_ // poses.count).integers(2**62))

    def source_of(self, index: int) -> int:
        """Which of the plan's scenes this sample is of."""
        round_, chosen = self._place(index)
        if "scene" in chosen:
            return int(chosen["scene"])
        weights = np.array([source.weight for source in self.plan.scenes])
        rng = stream(self.plan.seed, "scene", round_ // self.plan.poses.count)
        return int(rng.choice(len(weights), p=weights / weights.sum()))

    def world_of(self, index: int) -> int:
        """Number shared by samples whose surfaces are worth keeping from one to the next."""
        return index // (self.plan.combinations * self.plan.poses.count)

    def _place(self, index: int) -> tuple[int, dict[str, Any]]:
        """Round of the grids, and the combination of their values within it."""
        round_, place = divmod(index, self.plan.combinations)
        chosen = {}
        for name, values in reversed(self.plan.axes.items()):  # the last runs fastest
            place, at = divmod(place, len(values))
            chosen[name] = values[at]
        return round_, chosen

    def _scene(
        self, source: SceneSource, round_: int
    ) -> tuple[dict[str, Any], Path, dict[str, Any]]:
        """Fields of the scene file, folder of its meshes, and the parameters of a family."""
        if source.scene is not None:
            fields = copy.deepcopy(self.files[f"scene {source.scene}"])
            return fields, self._scene_file(source.scene).parent, {}
        assert source.family is not None  # the source demands one of the two
        rng = stream(self.plan.seed, "family", source.family, round_)
        seed = int(rng.integers(source.distinct or SCENE_SEEDS))
        # Distinct scenes come again with their parameters: those follow from the scene's seed.
        key = ("round", round_) if source.distinct is None else ("distinct", seed)
        parameters = {
            name: drawn_value(value, self.plan.seed, f"parameters.{name}", *key)
            for name, value in source.parameters.items()
        }
        told = {f"parameters.{name}": value for name, value in parameters.items()}
        fields = {"family": source.family, "seed": seed, "parameters": parameters}
        return fields, self.path.parent, {"family_seed": seed, **told}

    def _scene_file(self, name: str) -> Path:
        return find_named(self._beside(name), scenes_folder(), "scene")

    def _instrument_file(self, name: str) -> Path:
        return find_named(self._beside(name), PRESETS, "instrument")

    def _beside(self, name: str) -> str:
        """A file by its path from the plan, if there is one; else the name as it stands."""
        beside = self.path.parent / name
        return str(beside) if is_file(beside) else name


def order_of(fields: Mapping[str, Any]) -> list[str]:
    """Names in those sections of a plan that are gone through in the order given."""
    return [name for section in ("vary", "materials") for name in fields.get(section) or {}]


def load_plan(path: Path, kind: type[Plan] = Plan) -> PlannedSet:
    """Plan from a YAML file; InputError, naming file and field, for whatever is wrong with it."""
    text = read_text(path)
    return PlannedSet(parse_model(text, kind, path), text, path.absolute())


def _name_drawn(scene: Mapping[str, Any]) -> str | None:
    """Name that a scene of a family gets; None for others."""
    return f"{scene['family']}-{scene.get('seed') or 0}" if scene.get("family") else None


def _dump(fields: Mapping[str, Any]) -> str:
    kept = {name: value for name, value in fields.items() if value is not None}
    return dump_yaml(kept)
