"""Fixtures that several unit tests share."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

from scenefiles import Load
from spisim.instrument import Instrument, load_instrument
from spisim.scene import Scene, load_scene


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Load a scene from YAML text, in a folder with two meshes."""
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "solid.ply")
    gappy = trimesh.creation.icosphere(2, 1.0)
    gappy.update_faces(np.arange(len(gappy.faces)) % 10 != 0)
    gappy.export(tmp_path / "gappy.ply")
    room = trimesh.creation.box((20, 20, 20))
    room.invert()
    room.export(tmp_path / "room.ply")

    def load_text(text: str) -> Scene:
        path = tmp_path / "scene.yaml"
        path.write_text(text, encoding="utf-8")
        return load_scene(path)

    return load_text


@pytest.fixture(scope="session")
def paper() -> Instrument:
    """The instrument of the paper."""
    return load_instrument("paper")


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    """A folder in memory where there is one: a disk takes long to write a file again and again."""
    memory = Path("/dev/shm")
    if not os.access(memory, os.W_OK):
        yield tmp_path
        return
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        yield Path(folder)
