"""Poses of SDFormat: frames relative to other frames, by name.

SDFormat 1.7 and later, http://sdformat.org/tutorials?tut=pose_frame_semantics.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.scene.pose import pose_matrix
from spisim_formats.library.files import quoted
from spisim_formats.library.xml import numbers

SEPARATOR = "::"
MAX_DEPTH = 200
NAMELESS = "a model, link, joint or frame in it has no name"


def read_pose(element: Element | None, what: str) -> tuple[Floats, str]:
    """Return the matrix (4, 4) of a `<pose>` and its reference frame; identity if there is none."""
    if element is None or not (element.text or "").strip():
        return np.eye(4), "" if element is None else element.get("relative_to", "")
    relative_to = element.get("relative_to", "")
    if element.get("rotation_format", "euler_rpy") == "quat_xyzw":
        values = numbers(element.text, 7, f"{what}: pose")
        if not np.linalg.norm(values[3:]) > 0:
            raise InputError(f"{what}: pose: the quaternion is zero")
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat(values[3:]).as_matrix()
        matrix[:3, 3] = values[:3]
        return matrix, relative_to
    values = numbers(element.text, 6, f"{what}: pose")
    in_degrees = element.get("degrees", "false").strip().lower() in ("true", "1")
    angles = values[3:] if in_degrees else np.degrees(values[3:])
    return pose_matrix(angles, values[:3]), relative_to


class Frames:
    """The frames of a world or model, each with a pose relative to another or to the root."""

    def __init__(self, root: str, what: str) -> None:
        self._root = root  # "world" or "__model__"
        self._what = what
        self._poses: dict[str, tuple[Floats, str]] = {}
        self._inner: dict[str, Frames] = {}

    def add(self, name: str, pose: Floats, relative_to: str, inner: Frames | None = None) -> None:
        """Add a frame, and for a model its own frames. Raises InputError if its name is taken."""
        if not name:
            raise InputError(f"{self._what}: {NAMELESS}")
        if name in self._poses or name == self._root:
            raise InputError(f"{self._what}: two things in it are named {quoted(name)}")
        self._poses[name] = (pose, relative_to)
        if inner is not None:
            self._inner[name] = inner

    def add_if_free(self, name: str, pose: Floats, relative_to: str) -> bool:
        """Add a frame of a joint or merged model if its name is free; return whether it was.

        Gazebo distinguishes such names by what they name; nearly always poses are relative to the
        other one.
        """
        if name in self._poses:
            return False
        self.add(name, pose, relative_to)
        return True

    def merge(self, inner: Frames, name: str) -> None:
        """Add the frames of a model merged into this one, if their names are free."""
        for each in inner._poses:
            self.add_if_free(each, inner.pose(each), name)

    def pose(self, name: str, path: tuple[str, ...] = ()) -> Floats:
        """Return the pose (4, 4) of a frame in the root, "". Raises InputError if undefined."""
        if name in ("", self._root):
            return np.eye(4)
        if name in path:
            raise InputError(f"{self._what}: poses go in a circle: {_chain(*path, name)}")
        if len(path) > MAX_DEPTH:
            raise InputError(
                f"{self._what}: poses are relative to one another more than {MAX_DEPTH} deep"
            )
        if name in self._poses:
            matrix, relative_to = self._poses[name]
            return self.pose(relative_to, (*path, name)) @ matrix
        outer, separator, rest = name.partition(SEPARATOR)
        if separator and outer in self._inner:
            return self.pose(outer, (*path, name)) @ self._inner[outer].pose(rest)
        candidate = nearest(name, (self._root, *self._poses))
        raise InputError(f"{self._what}: no frame {quoted(name)}: {candidate}")


def _chain(*names: str) -> str:
    return " → ".join(name[:80] for name in names[:20])
