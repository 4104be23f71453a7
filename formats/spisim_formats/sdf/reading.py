"""Gazebo worlds and models (SDFormat .sdf, .world): their visuals.

It is a parser of its own, because there is no maintained Python package of libsdformat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TypeAlias
from xml.etree.ElementTree import Element

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, LimitError
from spisim_formats.library.content import Content, Glow, Part
from spisim_formats.library.files import Folders, quoted, read_bytes
from spisim_formats.library.frames import Frames, read_pose
from spisim_formats.library.records import mark_all, unread_elements, words
from spisim_formats.library.xml import parse_lenient_xml
from spisim_formats.sdf.light import Light, lamp, moved, take_fog, take_lights
from spisim_formats.sdf.visual import Visuals

MAX_INCLUDE_DEPTH = 16
MAX_INCLUDES = 5000
#: Root elements, today and before SDFormat 1.3.
ROOTS = ("sdf", "gazebo")
#: What light does not see, and of joints what does not place frames.
HARMLESS = words("""
@name @id sdf@version model@canonical_link frame@attached_to light@type joint@type joint/parent
joint/axis joint/axis2 joint/physics joint/sensor joint/thread_pitch joint/gearbox_ratio
joint/gearbox_reference_body allow_auto_disable atmosphere audio collision enable_wind gravity
gripper gui inertial kinematic link/sensor magnetic_field must_be_base_link physics plugin projector
self_collide static velocity_decay wind wind_mode spherical_coordinates scene/grid
scene/origin_visual scene/background scene/shadows light/cast_shadows light/specular
light/visualize visual/cast_shadows visual/meta material/ambient material/shader
material/lighting material/render_order material/double_sided script/uri
heightmap/use_terrain_paging heightmap/sampling
""")


@np.errstate(all="ignore")  # poses are checked later to be finite
def read_sdf(path: Path, folders: Folders) -> Content:
    """Read the visuals of a world or model, in metres, z up, with joints at rest.

    Elements that cannot be read or have dangling references are left out with a note. Raises
    InputError if nothing is left, and for circular includes.
    """
    content = Content(unit_why="SDFormat is in metres", up_why="Gazebo has z up")
    reader = _Reader(folders, Visuals(folders, content))
    root = reader.parse(path)
    worlds = root.findall("world")
    if len(worlds) > 1:
        content.note(f"{path.name}: only the first of {len(worlds)} worlds is read")
    top = worlds[0] if worlds else root
    what = f"world {quoted(top.get('name', ''))}" if worlds else path.name
    scope = _Scope(path, (path.resolve(),), what)
    frames = Frames("world", what)
    for model, pose in reader.models(top, frames, scope):
        model.show(pose, content)
    lights = [*reader.lights(top, frames, scope), *reader.included_lights]
    take_lights(lights, top.find("scene"), content, what)
    take_fog(top.find("scene"), content, what)
    content.check_not_empty(path, "has no visuals; collision shapes are not read")
    return content


@dataclass(frozen=True)
class _Scope:
    """The context of an element: its file, the chain of including files, its name."""

    path: Path
    chain: tuple[Path, ...]
    what: str

    def within(self, kind: str, name: str) -> _Scope:
        return _Scope(self.path, self.chain, f"{self.what}: {kind} {quoted(name)}")


@dataclass
class _Model:
    """A model with its parts in its own frame."""

    name: str
    frames: Frames
    parts: list[Part] = field(default_factory=list)
    glows: list[Glow] = field(default_factory=list)

    def show(self, pose: Floats, content: Content) -> None:
        """Add all parts and lamps to the content, with the model at a pose."""
        content.glows += [moved(glow, pose) for glow in self.glows]
        for part in self.parts:
            content.add(Part(part.name, part.geometry, pose @ part.to_world, part.surface))


#: A model, its pose, the reference frame, and the frame of the model at that pose.
_PosedModel: TypeAlias = tuple[_Model, Floats, str, str]


class _Reader:
    def __init__(self, folders: Folders, visuals: Visuals) -> None:
        self._folders = folders
        self._visuals = visuals
        self._content = visuals.content
        self.included_lights: list[Light] = []
        self._includes = 0
        self._roots: dict[Path, Element] = {}

    def parse(self, path: Path) -> Element:
        if path in self._roots:
            return self._roots[path]
        root = self._roots[path] = parse_lenient_xml(read_bytes(path), path, self._content.note)
        self._content.records.append((path.name, partial(unread_elements, root, HARMLESS)))
        if root.tag not in ROOTS:
            raise InputError(f"{path}: is no SDFormat: its root is <{root.tag}>, not <sdf>")
        return root

    def models(self, parent: Element, frames: Frames, scope: _Scope) -> list[tuple[_Model, Floats]]:
        """Return the models of a world or model, including included ones, with their poses in it.

        Their frames, and those that the parent defines itself, are added to `frames`.
        """
        result: list[_Model] = []
        for child in parent:
            if child.tag not in ("model", "include"):
                continue
            is_include = child.tag == "include"
            name = (child.findtext("uri") if is_include else child.get("name")) or ""
            inside = scope.within(child.tag, name.strip())
            with self._content.leaving_out(inside.what, partial(mark_all, child)):
                posed = self._include(child, scope) if is_include else self._nested(child, inside)
                if posed is None:
                    continue
                model, pose, relative_to, placement = posed
                pose = pose @ np.linalg.inv(model.frames.pose(placement))
                frames.add(model.name, pose, relative_to, model.frames)
                if is_include and child.get("merge", "").lower() in ("true", "1"):
                    frames.merge(model.frames, model.name)
                result.append(model)
        self._add_frames(parent, frames, scope)
        poses = []
        for model in result:
            with self._content.leaving_out(scope.within("model", model.name).what):
                poses.append((model, frames.pose(model.name)))
        return poses

    def _nested(self, element: Element, scope: _Scope) -> _PosedModel:
        model = self._model(element, scope)
        pose, relative_to = read_pose(element.find("pose"), scope.what)
        return model, pose, relative_to, element.get("placement_frame", "")

    def _model(self, element: Element, scope: _Scope) -> _Model:
        frames = Frames("__model__", scope.what)
        model = _Model(element.get("name", ""), frames)
        if not model.name:
            raise InputError(f"{scope.what}: has no name")
        links = []
        for link in element.findall("link"):
            inside = scope.within("link", link.get("name", ""))
            with self._content.leaving_out(inside.what, partial(mark_all, link)):
                frames.add(link.get("name", ""), *read_pose(link.find("pose"), inside.what))
                links.append(link)
        self._add_joints(element, frames, scope)
        inner = self.models(element, frames, scope)
        for link in links:
            self._link(link, model, scope.within("link", link.get("name", "")))
        for nested, pose in inner:
            for part in nested.parts:
                name = f"{model.name} {part.name}"
                to_world = pose @ part.to_world
                model.parts.append(Part(name, part.geometry, to_world, part.surface))
            model.glows += [moved(glow, pose) for glow in nested.glows]
        return model

    def lights(
        self, parent: Element, frames: Frames, scope: _Scope, within: str = ""
    ) -> list[Light]:
        """Return the lights of a world or link, which is frame `within`, with their poses."""
        result = []
        for element in parent.findall("light"):
            what = scope.within("light", element.get("name", "")).what
            with self._content.leaving_out(what, partial(mark_all, element)):
                pose, relative_to = read_pose(element.find("pose"), what)
                result.append(Light(element, frames.pose(relative_to or within) @ pose, what))
        return result

    def _link(self, link: Element, model: _Model, scope: _Scope) -> None:
        for visual in link.findall("visual"):
            inside = scope.within("visual", visual.get("name", ""))
            with self._content.leaving_out(inside.what, partial(mark_all, visual)):
                pose, relative_to = read_pose(visual.find("pose"), inside.what)
                frame = model.frames.pose(relative_to or link.get("name", "")) @ pose
                name = " ".join(filter(None, (model.name, visual.get("name", ""))))
                for part in self._visuals.read(visual, scope.path, inside.what):
                    to_model = frame @ part.to_world
                    model.parts.append(Part(name, part.geometry, to_model, part.surface))
        for light in self.lights(link, model.frames, scope, link.get("name", "")):
            model.glows += lamp(light, self._content)

    def _add_frames(self, parent: Element, frames: Frames, scope: _Scope) -> None:
        for frame in parent.findall("frame"):
            inside = scope.within("frame", frame.get("name", ""))
            name = frame.get("name", "")
            with self._content.leaving_out(inside.what):
                pose, relative_to = read_pose(frame.find("pose"), inside.what)
                if not frames.add_if_free(name, pose, relative_to or frame.get("attached_to", "")):
                    self._note_taken("frame", name, scope)

    def _add_joints(self, element: Element, frames: Frames, scope: _Scope) -> None:
        for joint in element.findall("joint"):
            inside = scope.within("joint", joint.get("name", ""))
            child = (joint.findtext("child") or "").strip()
            name = joint.get("name", "")
            with self._content.leaving_out(inside.what):
                pose, relative_to = read_pose(joint.find("pose"), inside.what)
                if not frames.add_if_free(name, pose, relative_to or child):
                    self._note_taken("joint", name, scope)

    def _note_taken(self, kind: str, name: str, scope: _Scope) -> None:
        self._content.note(
            f"{scope.what}: {kind} {quoted(name)} is called as something else; poses are "
            "relative to that"
        )

    def _include(self, element: Element, scope: _Scope) -> _PosedModel | None:
        """Return the model that an `<include>` names; None for an actor or a light."""
        uri = (element.findtext("uri") or "").strip()
        what = f"{scope.what}: include {quoted(uri)}"
        self._includes += 1
        if self._includes > MAX_INCLUDES:
            raise LimitError(f"{what}: more than {MAX_INCLUDES:,} includes")
        folders = self._folders
        path = self._model_file(folders.find(uri, scope.path.parent, what, folders.roots), what)
        if path in scope.chain:
            names = " → ".join(str(link) for link in (*scope.chain, path))
            raise LimitError(f"{what}: includes itself: {names}")
        if len(scope.chain) > MAX_INCLUDE_DEPTH:
            raise LimitError(f"{what}: includes are nested more than {MAX_INCLUDE_DEPTH} deep")
        root = self.parse(path)
        included = root.find("model")
        if included is None:
            light = root.find("light")
            if root.find("actor") is None and light is None:
                raise InputError(f"{what}: {path} holds no model")
            if light is None:
                self._content.note("actors that are included are left out")
                return None
            posed = light if element.find("pose") is None else element
            pose, _ = read_pose(posed.find("pose"), what)
            self.included_lights.append(Light(light, pose, what))
            return None
        name = (element.findtext("name") or included.get("name") or "").strip()
        model = self._model(included, _Scope(path, (*scope.chain, path), f"{path.name}"))
        model.name = name
        included.find("pose")  # counts as read where the include's comes before it
        posed = included if element.find("pose") is None else element
        pose, relative_to = read_pose(posed.find("pose"), what)
        placement = (element.findtext("placement_frame") or "").strip()
        if not placement and posed is included:
            placement = included.get("placement_frame", "")
        return model, pose, relative_to, placement

    def _model_file(self, result: Path, what: str) -> Path:
        """Return the SDF file of a model folder according to model.config; a file is itself."""
        if not result.is_dir():
            return result
        config, names = result / "model.config", {}
        if config.is_file():
            with self._content.leaving_out(str(config)):
                described = parse_lenient_xml(read_bytes(config), config, self._content.note)
                names = {_version(row): (row.text or "").strip() for row in described.iter("sdf")}
        file = names[max(names)] if names else "model.sdf"
        return self._folders.find(file, result, f"{what}: sdf")


def _version(row: Element) -> float:
    try:
        version = float(row.get("version", "0"))
    except ValueError:
        return 0.0
    return version if math.isfinite(version) else 0.0
