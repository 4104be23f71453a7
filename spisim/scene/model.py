"""Scenes in memory: surfaces and media in world coordinates, daylight, drone, and motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.display import drawing, figure, html_summary, panels, text_summary
from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere import Atmosphere
from spisim.atmosphere.precipitation import Precipitation
from spisim.atmosphere.structure import Structure
from spisim.scene.lamps import Lamp
from spisim.scene.materials import Material
from spisim.scene.pose import Vector3, moved_pose

STILL: Vector3 = (0.0, 0.0, 0.0)


class SceneWarning(UserWarning):
    """A scene can be simulated but may not mean what its author intends."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """A named surface; velocities are in world axes, about the centre of its bounds.

    Copies that differ by a rigid motion alone share their `original` mesh.
    """

    name: str
    mesh: trimesh.Trimesh  # world coordinates, metres
    material: Material
    velocity_m_s: Vector3 = STILL
    angular_velocity_rad_s: Vector3 = STILL
    original: trimesh.Trimesh | None = None

    @property
    def moves(self) -> bool:
        """Whether it has any velocity."""
        return any(self.velocity_m_s) or any(self.angular_velocity_rad_s)

    def motion(self, time_s: float) -> Floats:
        """Rigid motion (4, 4) from the object's pose now to that after `time_s`."""
        centre = self.mesh.bounds.mean(axis=0)
        return moved_pose(centre, self.velocity_m_s, self.angular_velocity_rad_s, time_s)

    def at(self, time_s: float) -> SceneObject:
        """The object after `time_s`; itself if it does not move."""
        if not self.moves:
            return self
        return replace(self, mesh=self.mesh.copy().apply_transform(self.motion(time_s)))


@dataclass(frozen=True, eq=False)
class Volume:
    """A part of space filled with a medium, in addition to the atmosphere.

    `to_world` (4, 4) places the unit cube [0, 1]³ in the world. The volume is that cube, its
    inscribed ball, or the interior of a closed mesh in it, in world coordinates. `density` (nz, ny,
    nx) is relative to the medium's extinction, at the centres of the cells of the cube, linear
    between and constant beyond them; None is 1 everywhere. A `structure` gives it after `age_s`.
    The volume moves with its `carrier`.
    """

    name: str
    medium: Atmosphere
    to_world: Floats
    density: NDArray[np.float32] | None = None
    structure: Structure | None = None
    age_s: float = 0.0
    shape: Literal["box", "ball"] | trimesh.Trimesh = "box"
    carrier: SceneObject | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves or its density changes with time."""
        return self._drifts or self._is_carried

    def at(self, time_s: float) -> Volume:
        """The volume after `time_s`; itself if nothing moves or drifts."""
        moved = self
        if self._is_carried:
            assert self.carrier is not None
            assert isinstance(self.shape, trimesh.Trimesh)
            motion = self.carrier.motion(time_s)
            shape = self.shape.copy().apply_transform(motion)
            carrier = self.carrier.at(time_s)
            moved = replace(moved, to_world=motion @ self.to_world, shape=shape, carrier=carrier)
        if self._drifts:
            assert self.structure is not None
            age_s = self.age_s + time_s
            density = self.structure.density(moved.to_world, age_s)
            moved = replace(moved, age_s=age_s, density=density)
        return moved

    @property
    def _drifts(self) -> bool:
        return self.structure is not None and self.structure.drifts

    @property
    def _is_carried(self) -> bool:
        return self.carrier is not None and self.carrier.moves


@dataclass(frozen=True)
class Ambient:
    """Daylight outside; how much reaches a surface depends on the scene's openings."""

    sun_klx: float = 0.0  # illuminance of a surface normal to the sun
    sun_direction: Vector3 = (0.0, 0.0, -1.0)  # unit, from the sun, world
    sky_klx: float = 0.0  # horizontal illuminance under a uniform sky


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that light meets, and the pose of the instrument.

    `drone_pose` (4, 4) maps the instrument's optical frame (x right, y down, z forward, metres) to
    the world (z up). The drone's velocities are in world axes, about its position. `text` is the
    YAML that the scene was made from, or "". The drops of `precipitation` are separate from the
    atmosphere. Materials and media are those at `wavelength_nm`.
    """

    name: str
    objects: tuple[SceneObject, ...]
    atmosphere: Atmosphere
    ambient: Ambient
    drone_pose: Floats
    text: str = ""
    volumes: tuple[Volume, ...] = ()
    drone_velocity_m_s: Vector3 = STILL
    drone_angular_velocity_rad_s: Vector3 = STILL
    precipitation: tuple[Precipitation, ...] = ()
    wavelength_nm: float = 1550.0
    lamps: tuple[Lamp, ...] = ()

    def _repr_html_(self) -> str:
        bounds = [thing.mesh.bounds[:, :2] for thing in self.objects]
        drone, ahead = self.drone_pose[:2, 3], self.drone_pose[:2, 2]
        corners = np.reshape([*bounds, (drone, drone)], (-1, 2))
        low, high = corners.min(axis=0), corners.max(axis=0)
        size = 1.1 * float((high - low).max()) or 1.0
        low, high = (low + high - size) / 2, (low + high + size) / 2
        line = f'stroke-width="{size / 200:.4g}"'
        boxes = [
            f'<rect x="{x:.5g}" y="{y:.5g}" width="{right - x:.5g}" height="{top - y:.5g}" {line}/>'
            for (x, y), (right, top) in bounds
        ]
        end = drone + 0.15 * size * ahead
        boxes.append(
            f'<g stroke="crimson"><circle cx="{drone[0]:.5g}" cy="{drone[1]:.5g}" '
            f'r="{size / 60:.4g}" {line}/><path d="M {drone[0]:.5g} {drone[1]:.5g} '
            f'L {end[0]:.5g} {end[1]:.5g}" {line}/></g>'
        )
        above = figure(drawing(boxes, low, high), f"from above, {size:.3g} m wide; red: the drone")
        return html_summary(f"Scene {self.name}", self._facts, [above])

    def __repr__(self) -> str:
        return text_summary(f"Scene {self.name}", self._facts)

    @property
    def _facts(self) -> dict[str, Any]:
        media = [f"{medium['where']}: {medium['kind']}" for medium in self.media_summary()]
        return {
            "objects": len(self.objects),
            "triangles": f"{sum(len(thing.mesh.faces) for thing in self.objects):,}",
            "air": ", ".join(media) or "clear",
            "sun and sky": f"{self.ambient.sun_klx:g} and {self.ambient.sky_klx:g} klx",
            "lamps": len(self.lamps),
            "moves": "yes" if self.moves else "no",
        }

    def plot(self) -> Any:
        """Plot the bounds of all surfaces from above and from the side, and the drone in red.

        Returns
        -------
        array of Axes, (2,)
            Matplotlib's; InputError if it is not installed.
        """
        axes = panels(2)
        views = zip(axes, ("from above", "from the side"), ("xy", "xz"), strict=True)
        for plane, title, names in views:
            across, up = ("xyz".index(name) for name in names)
            for thing in self.objects:
                (left, right), (low, high) = (thing.mesh.bounds[:, each] for each in (across, up))
                outline = [left, right, right, left, left], [low, low, high, high, low]
                plane.plot(*outline, color="0.4", linewidth=1)
            position, ahead = self.drone_pose[:3, 3], self.drone_pose[:3, 2]
            plane.plot(position[across], position[up], "o", color="crimson")
            plane.quiver(position[across], position[up], ahead[across], ahead[up], color="crimson")
            plane.set(title=title, xlabel=f"{names[0]}, m", ylabel=f"{names[1]}, m", aspect="equal")
        return axes

    @property
    def drone_moves(self) -> bool:
        """Whether the drone has any velocity."""
        return any(self.drone_velocity_m_s) or any(self.drone_angular_velocity_rad_s)

    @property
    def moves(self) -> bool:
        """Whether anything has any velocity."""
        parts: tuple[SceneObject | Volume, ...] = (*self.objects, *self.volumes)
        return self.drone_moves or any(part.moves for part in parts)

    def media_summary(self) -> list[dict[str, Any]]:
        """Media in plain numbers, and `where` each is; empty for clear air.

        Lists the mixture in the air, its parts, single drops, and each volume at density 1.
        """
        air = self.atmosphere
        media: list[tuple[str, Atmosphere | Precipitation]] = []
        if air.extinction_per_m > 0:
            media += [("air", air)]
        media += [("air, part", part) for part in air.parts]
        media += [("air, single drops", falling) for falling in self.precipitation]
        media += [(f"volume {volume.name}", volume.medium) for volume in self.volumes]
        return [{"where": where, **medium.summary()} for where, medium in media]

    def drone_pose_at(self, time_s: float) -> Floats:
        """The drone's pose (4, 4) after `time_s`."""
        motion = moved_pose(
            self.drone_pose[:3, 3],
            self.drone_velocity_m_s,
            self.drone_angular_velocity_rad_s,
            time_s,
        )
        return motion @ self.drone_pose

    def at(self, time_s: float) -> Scene:
        """The scene after `time_s`: objects moved, fog drifted; itself if nothing moves."""
        if not self.moves:
            return self
        return replace(
            self,
            objects=tuple(thing.at(time_s) for thing in self.objects),
            volumes=tuple(volume.at(time_s) for volume in self.volumes),
            drone_pose=self.drone_pose_at(time_s),
        )


def find_object(name: str, objects: Sequence[SceneObject]) -> SceneObject:
    """The object of this name; InputError, naming the nearest, if there is none."""
    for thing in objects:
        if thing.name == name:
            return thing
    candidate = nearest(name, [thing.name for thing in objects])
    raise InputError(f"object {name!r} is not in the scene: {candidate}")
