"""Images with poses and `transforms.json`, one folder per scene with true depth."""

from spisim_formats.recordings.nerf import write_nerf
from spisim_formats.samples._writing import write_by_scene

EXPORT = write_by_scene(write_nerf)
