"""True point clouds as PCD files, one folder per scene."""

from reconstruction.exports.formats.pcd import write_pcd
from spisim_formats.samples._writing import write_by_scene

EXPORT = write_by_scene(write_pcd)
