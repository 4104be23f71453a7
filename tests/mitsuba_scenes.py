"""Scene files of Mitsuba for tests of their import."""

from pathlib import Path

import numpy as np
import trimesh

CUBE = trimesh.creation.box((2, 2, 2))


def scene(path: Path, body: str, version: str = "3.0.0") -> Path:
    path.write_text(f'<scene version="{version}">{body}</scene>')
    return path


def shape(kind: str, body: str = "", steps: str = "") -> str:
    transform = f'<transform name="to_world">{steps}</transform>'
    return f'<shape type="{kind}">{body}{transform}</shape>'


def turned(axis: list[float], degrees: float) -> np.ndarray:
    return trimesh.transformations.rotation_matrix(np.radians(degrees), axis)
