"""SDFormat: models and worlds of Gazebo; written ones may have sensors."""

from spisim_formats.format import SceneFormat, lazily

FORMAT = SceneFormat(
    "SDFormat",
    dict.fromkeys((".sdf", ".world"), lazily("spisim_formats.sdf.reading:read_sdf")),
    {".sdf": lazily("spisim_formats.sdf.writing:sdf_files")},
)
