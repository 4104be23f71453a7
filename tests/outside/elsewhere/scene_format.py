"""A format of scenes: a text file with the edge of a wooden crate in centimetres."""

from pathlib import Path

import numpy as np
import trimesh

from spisim_formats import SceneFormat
from spisim_formats.library.content import Content, Part, Surface
from spisim_formats.library.files import Folders


def read(path: Path, folders: Folders) -> Content:
    content = Content(unit_m=0.01, unit_why="edges are in centimetres")
    edge = float(path.read_text())
    content.add(Part("crate", trimesh.creation.box([edge] * 3), np.eye(4), Surface("wood")))
    return content


FORMAT = SceneFormat("crates", {".crate": read})
