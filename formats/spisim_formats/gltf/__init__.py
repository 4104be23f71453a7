"""glTF 2.0 of Khronos, text and binary; scenes are written as binary glTF."""

from spisim_formats.format import SceneFormat, lazily

FORMAT = SceneFormat(
    "glTF",
    {
        ".glb": lazily("spisim_formats.gltf.reading:read_glb"),
        ".gltf": lazily("spisim_formats.gltf.reading:read_gltf"),
    },
    {".glb": lazily("spisim_formats.gltf.writing:glb_files")},
    meshes=True,
)
