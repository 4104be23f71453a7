"""RGB-D sequences in the layout of TUM and Redwood, one folder per scene with true depth."""

from reconstruction.exports.formats.rgbd import write_rgbd
from spisim_formats.samples._writing import write_by_scene

EXPORT = write_by_scene(write_rgbd)
