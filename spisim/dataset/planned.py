"""A plan together with its file, and the samples that it asks for."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from reconstruction.base.errors import naming
from spisim.base.config import (
    dump_yaml,
    find_named,
    is_file,
    load_yaml,
    parse_model,
    read_mapping,
    read_text,
)
from spisim.base.config.distributions import stream
from spisim.dataset.plan import Plan, SceneSource, is_field
from spisim.dataset.poses import View
from spisim.dataset.values import (
    drawn_value,
    section_of,
    set_field,
)
from spisim.instrument import Instrument
from spisim.instrument.model import PRESETS
from spisim.scene import scenes_folder
from spisim.scene.description import SceneDescription

#: Seeds of scenes are below this.
SCENE_SEEDS = 2**31


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
        reported: dict[str, Any] = {"instrument": instrument} if "instrument" in chosen else {}
        if plan.poses.count > 1:
            reported["pose"] = number
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
            {"scene": source.family or name, **reported, **parameters, **drawn},
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
        round_, position = divmod(index, self.plan.combinations)
        chosen = {}
        for name, values in reversed(self.plan.axes.items()):  # the last runs fastest
            position, at = divmod(position, len(values))
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
        reported = {f"parameters.{name}": value for name, value in parameters.items()}
        fields = {"family": source.family, "seed": seed, "parameters": parameters}
        return fields, self.path.parent, {"family_seed": seed, **reported}

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


def stated_plan(fields: Mapping[str, Any], kind: type[Plan] = Plan) -> PlannedSet:
    """Plan from the fields of a file; files that it names lie in the working folder.

    Raises InputError, naming the field, for whatever is wrong with it.
    """
    text = dump_yaml(fields)
    return PlannedSet(parse_model(text, kind, "plan"), text, Path("plan").absolute())


def _name_drawn(scene: Mapping[str, Any]) -> str | None:
    """Name that a scene of a family gets; None for others."""
    return f"{scene['family']}-{scene.get('seed') or 0}" if scene.get("family") else None


def _dump(fields: Mapping[str, Any]) -> str:
    retained = {name: value for name, value in fields.items() if value is not None}
    return dump_yaml(retained)
