"""A plan with its file, and the samples that it describes."""

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
from spisim.dataset.plan import SCENE_SEEDS, Plan, SceneSource, is_field
from spisim.dataset.poses import View
from spisim.dataset.values import drawn_value, has_integer_bounds, section_of, set_field
from spisim.instrument import Instrument
from spisim.instrument.model import PRESETS
from spisim.scene import scenes_folder
from spisim.scene.description import SceneDescription


@dataclass(frozen=True)
class Sample:
    """One sample of a plan, ready to be simulated, and its parameters."""

    index: int
    seed: int
    scene_name: str  # equal for samples of the same scene
    scene_fields: dict[str, Any]
    scene_folder: Path
    instrument_fields: dict[str, Any]
    instrument_folder: Path
    wavelength_nm: float | None  # of the instrument, if the plan sets it
    view: View
    parameters: Mapping[str, Any]  # by field of the plan


@dataclass(frozen=True)
class PlannedSet:
    """A plan, its text, and its file."""

    plan: Plan
    text: str
    path: Path

    @cached_property
    def fields(self) -> dict[str, Any]:
        """The fields of the plan file except the number of samples."""
        fields: dict[str, Any] = load_yaml(self.text, self.path)
        return {name: value for name, value in fields.items() if name != "samples"}

    @cached_property
    def files(self) -> dict[str, dict[str, Any]]:
        """Fields of the files that the plan names, as read the first time.

        Raises InputError if one is missing or not valid YAML.
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
        """SHA-256 of all that samples depend on: the plan except their number, and its files."""
        content = [self.fields, order_of(self.fields), self.files]
        if has_integer_bounds(self.fields):
            content.append("real numbers")
        return hashlib.sha256(yaml.safe_dump(content).encode()).hexdigest()

    def with_samples(self, samples: int) -> PlannedSet:
        """Return the plan with another number of samples; its text loses its comments."""
        text = dump_yaml({**self.fields, "samples": samples})
        return replace(self, plan=self.plan.model_copy(update={"samples": samples}), text=text)

    def sample(self, index: int) -> Sample:
        """Return the sample of this index, which depends only on the plan, its files and the index.

        Raises InputError, naming the plan, for unknown fields.
        """
        plan, seed = self.plan, self.plan.seed
        round_, chosen = self._combination(index)
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
                    set_field(
                        files[file], field, copy.deepcopy(value)
                    )  # its fields may be set next
                elif file == "materials":
                    section_of(scene, "material_swaps", path)[field] = value
        name = scene.get("name") or _name_drawn(scene) or str(source.scene)
        gridded: dict[str, Any] = {"instrument": instrument} if "instrument" in chosen else {}
        if plan.poses.count > 1:
            gridded["pose"] = number
        return Sample(
            index,
            int(stream(seed, "capture", index).integers(2**62)),
            name,
            _given(scene),
            folder,
            _given(files["instrument"]),
            self._instrument_file(instrument).parent,
            drawn.get("wavelength_nm"),
            View(number, plan.poses, self._pose_seed(round_)),
            {"scene": source.family or name, **gridded, **parameters, **drawn},
        )

    def _pose_seed(self, round_: int) -> int:
        """Return the seed of a single pose, or of the flight of a scene."""
        poses, seed = self.plan.poses, self.plan.seed
        if poses.flight_s is None:
            return int(stream(seed, "pose", round_).integers(2**62))
        return int(stream(seed, "flight", round_ // poses.count).integers(2**62))

    def source_of(self, index: int) -> int:
        """Return the index of a sample's scene in the plan."""
        round_, chosen = self._combination(index)
        if "scene" in chosen:
            return int(chosen["scene"])
        weights = np.array([source.weight for source in self.plan.scenes])
        rng = stream(self.plan.seed, "scene", round_ // self.plan.poses.count)
        return int(rng.choice(len(weights), p=weights / weights.sum()))

    def world_of(self, index: int) -> int:
        """Return the first of the samples whose surfaces are worth reusing."""
        together = self.plan.combinations * self.plan.poses.count
        return index // together * together

    def _combination(self, index: int) -> tuple[int, dict[str, Any]]:
        """Return the round of the grids, and the combination of their values within it."""
        round_, rest = divmod(index, self.plan.combinations)
        chosen = {}
        for name, values in reversed(self.plan.axes.items()):  # the last runs fastest
            rest, position = divmod(rest, len(values))
            chosen[name] = values[position]
        return round_, chosen

    def _scene(
        self, source: SceneSource, round_: int
    ) -> tuple[dict[str, Any], Path, dict[str, Any]]:
        """Return fields of the scene file, folder of its meshes, and parameters of a family."""
        if source.scene is not None:
            fields = copy.deepcopy(self.files[f"scene {source.scene}"])
            return fields, self._scene_file(source.scene).parent, {}
        assert source.family is not None
        rng = stream(self.plan.seed, "family", source.family, round_)
        seed = int(rng.integers(source.distinct or SCENE_SEEDS))
        # Distinct scenes recur with their parameters, which follow from the scene's seed.
        key = ("round", round_) if source.distinct is None else ("distinct", seed)
        parameters = {
            name: drawn_value(value, self.plan.seed, f"parameters.{name}", *key)
            for name, value in source.parameters.items()
        }
        dotted = {f"parameters.{name}": value for name, value in parameters.items()}
        fields = {"family": source.family, "seed": seed, "parameters": parameters}
        return fields, self.path.parent, {"family_seed": seed, **dotted}

    def _scene_file(self, name: str) -> Path:
        return find_named(self._beside(name), scenes_folder(), "scene")

    def _instrument_file(self, name: str) -> Path:
        return find_named(self._beside(name), PRESETS, "instrument")

    def _beside(self, name: str) -> str:
        """Return a file by its path relative to the plan if it exists, else the name itself."""
        beside = self.path.parent / name
        return str(beside) if is_file(beside) else name


def order_of(fields: Mapping[str, Any]) -> list[str]:
    """Return the names in those sections of a plan whose order matters."""
    return [name for section in ("vary", "materials") for name in fields.get(section) or {}]


def load_plan(path: Path, kind: type[Plan] = Plan) -> PlannedSet:
    """Read a plan from a YAML file. Raises InputError, naming file and field."""
    text = read_text(path)
    return PlannedSet(parse_model(text, kind, path), text, path.absolute())


def stated_plan(fields: Mapping[str, Any], kind: type[Plan] = Plan) -> PlannedSet:
    """Return a plan given by its fields; file names are relative to the working folder.

    Raises InputError, naming the field.
    """
    text = dump_yaml(fields)
    return PlannedSet(parse_model(text, kind, "plan"), text, Path("plan").absolute())


def _name_drawn(scene: Mapping[str, Any]) -> str | None:
    """Return the name of a scene drawn from a family; None for others."""
    return f"{scene['family']}-{scene.get('seed') or 0}" if scene.get("family") else None


def _given(fields: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value is not None}
