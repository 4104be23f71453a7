"""Images with poses and `transforms.json`, one folder per scene with true depth."""

from reconstruction.exports.formats.nerf import write_nerf
from spisim.dataset.shots import write_by_scene

EXPORT = write_by_scene(write_nerf)
