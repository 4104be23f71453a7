"""COLLADA 1.4 of Khronos, read with pycollada."""

from spisim_formats.format import SceneFormat, lazily

FORMAT = SceneFormat(
    "COLLADA", {".dae": lazily("spisim_formats.collada.reading:read_collada")}, meshes=True
)
