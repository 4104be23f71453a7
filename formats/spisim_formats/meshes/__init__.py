"""Mesh files: Wavefront OBJ with its materials, STL, PLY and OFF, read with trimesh."""

from spisim_formats.format import SceneFormat, lazily

FORMAT = SceneFormat(
    "meshes",
    {
        f".{kind}": lazily(f"spisim_formats.meshes.reading:read_{kind}")
        for kind in ("obj", "stl", "ply", "off")
    },
    meshes=True,
)
