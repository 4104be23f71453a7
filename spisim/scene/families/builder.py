"""Builder of scenes: sections of a scene file and the meshes that they refer to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from spisim.scene.families.parameters import Parameters

Point = Sequence[float]
#: Pose of a copy: rotation [roll, pitch, yaw] in degrees and translation in metres.
Pose = tuple[Point, Point]


@dataclass
class SceneBuilder:
    """Objects, drone and daylight of a scene, as fields of a scene file.

    Methods that add an object take its `name`, its `material`, the position of its origin (`at`,
    metres), a rotation applied before (`turn`, [roll, pitch, yaw] in degrees), or poses of several
    `copies`; `more` are other fields of an object, such as velocities.

    Parameters
    ----------
    position_m, look_at_m : Point
        Position of the drone and the point it looks at, world coordinates.
    sun_klx, sun_direction, sky_klx
        Daylight, as in scene files.
    materials : dict
        The builder's own materials by name, each with its fields.
    """

    position_m: Point
    look_at_m: Point
    sun_klx: float = 0.0
    sun_direction: Point = (0.0, 0.0, -1.0)
    sky_klx: float = 0.0
    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    objects: list[dict[str, Any]] = field(default_factory=list)
    meshes: dict[str, trimesh.Trimesh] = field(default_factory=dict)

    def box(self, name: str, material: str, size_m: Point, *args: Any, **more: Any) -> None:
        """Add a box with edges along x, y, z, centred on its origin."""
        self._add({"shape": "box", "size_m": _numbers(size_m)}, name, material, *args, **more)

    def rectangle(self, name: str, material: str, size_m: Point, *args: Any, **more: Any) -> None:
        """Add a rectangle with edges along x and y, centred on its origin, facing z."""
        self._add({"shape": "rectangle", "size_m": _numbers(size_m)}, name, material, *args, **more)

    def sphere(self, name: str, material: str, radius_m: float, *args: Any, **more: Any) -> None:
        """Add a sphere, centred on its origin."""
        self._add({"shape": "sphere", "radius_m": float(radius_m)}, name, material, *args, **more)

    def cylinder(
        self, name: str, material: str, size_m: tuple[float, float], *args: Any, **more: Any
    ) -> None:
        """Add a closed cylinder about z of radius and height, centred on its origin."""
        radius_m, height_m = _numbers(size_m)
        shape = {"shape": "cylinder", "radius_m": radius_m, "height_m": height_m}
        self._add(shape, name, material, *args, **more)

    def mesh(
        self, name: str, material: str, mesh: trimesh.Trimesh, *args: Any, **more: Any
    ) -> None:
        """Add a mesh in memory, in metres."""
        file = f"{name.replace(' ', '-')}.ply"
        self.meshes[file] = mesh
        self._add({"mesh": file}, name, material, *args, **more)

    def _add(
        self,
        shape: dict[str, Any],
        name: str,
        material: str,
        at: Point = (0.0, 0.0, 0.0),
        turn: Point = (0.0, 0.0, 0.0),
        copies: Sequence[Pose] = (),
        **more: Any,
    ) -> None:
        thing = {"name": name, **shape, "material": material, **_pose(turn, at)}
        if copies:
            thing["instances"] = [_pose(*pose) for pose in copies]
        self.objects.append(thing | more)

    def sections(self) -> dict[str, Any]:
        """Sections of a scene file: drone, ambient, objects, and materials if any."""
        sections: dict[str, Any] = {
            "drone": {
                "position_m": _numbers(self.position_m),
                "look_at_m": _numbers(self.look_at_m),
            },
            "ambient": {
                "sun_klx": float(self.sun_klx),
                "sun_direction": _numbers(self.sun_direction),
                "sky_klx": float(self.sky_klx),
            },
            "objects": self.objects,
        }
        return sections | ({"materials": self.materials} if self.materials else {})


@dataclass(frozen=True)
class Family:
    """A family of scenes; `build` makes a scene from parameters and a random generator.

    Draws repeat until `min_spots` of four laser spots return: all in closed worlds, fewer in
    open ones.
    """

    description: str
    parameters: type[Parameters]
    build: Callable[[Any, np.random.Generator], SceneBuilder]
    min_spots: int = 4


def _pose(turn: Point, at: Point) -> dict[str, list[float]]:
    """Non-default fields of a pose, rounded to micrometres and microdegrees."""
    pose = {"rotate_deg": _numbers(turn), "translate_m": _numbers(at)}
    return {name: values for name, values in pose.items() if any(values)}


def _numbers(values: Point) -> list[float]:
    return [round(float(value), 6) for value in values]
