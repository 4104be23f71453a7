"""A scene while it is being built: the sections of a scene file, and the meshes it refers to."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from spisim.scene.families.parameters import Parameters

Point = Sequence[float]
#: Rotation [roll, pitch, yaw] in degrees and place in metres of one of several copies.
Placed = tuple[Point, Point]


@dataclass
class SceneBuilder:
    """Objects, drone and daylight of a scene, in the words of a scene file.

    `materials` are those of the builder's own, by name, each with its fields.

    Every method that adds an object takes its `name`, its `material`, where its origin is put
    (`at`, metres) and how it is turned before (`turn`, [roll, pitch, yaw] in degrees), or several
    `copies` of that; `more` are other fields of an object, such as velocities.
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
        """A box with edges along x, y, z, centred on its origin."""
        self._add({"shape": "box", "size_m": _numbers(size_m)}, name, material, *args, **more)

    def rectangle(self, name: str, material: str, size_m: Point, *args: Any, **more: Any) -> None:
        """A rectangle with edges along x and y, centred on its origin, facing z."""
        self._add({"shape": "rectangle", "size_m": _numbers(size_m)}, name, material, *args, **more)

    def sphere(self, name: str, material: str, radius_m: float, *args: Any, **more: Any) -> None:
        """A sphere, centred on its origin."""
        self._add({"shape": "sphere", "radius_m": float(radius_m)}, name, material, *args, **more)

    def cylinder(
        self, name: str, material: str, size_m: tuple[float, float], *args: Any, **more: Any
    ) -> None:
        """A closed cylinder about z with radius and height, centred on its origin."""
        radius_m, height_m = _numbers(size_m)
        shape = {"shape": "cylinder", "radius_m": radius_m, "height_m": height_m}
        self._add(shape, name, material, *args, **more)

    def mesh(
        self, name: str, material: str, mesh: trimesh.Trimesh, *args: Any, **more: Any
    ) -> None:
        """Triangles of our own, in metres."""
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
        copies: Sequence[Placed] = (),
        **more: Any,
    ) -> None:
        thing = {"name": name, **shape, "material": material, **_pose(turn, at)}
        if copies:
            thing["instances"] = [_pose(*placed) for placed in copies]
        self.objects.append(thing | more)

    def sections(self) -> dict[str, Any]:
        """The sections of a scene file: drone, ambient, objects, and materials if it has any."""
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
    """A kind of scene; `build` makes one from its parameters, the rest at random.

    Draws are repeated until `min_spots` of the four laser spots return: all where the world is
    closed, fewer where it is open.
    """

    description: str
    parameters: type[Parameters]
    build: Callable[[Any, np.random.Generator], SceneBuilder]
    min_spots: int = 4


def _pose(turn: Point, at: Point) -> dict[str, list[float]]:
    """Fields of a pose that are not their defaults, to the micrometre and microdegree."""
    pose = {"rotate_deg": _numbers(turn), "translate_m": _numbers(at)}
    return {name: values for name, values in pose.items() if any(values)}


def _numbers(values: Point) -> list[float]:
    return [round(float(value), 6) for value in values]
