"""True point clouds as PCD files, of the samples of each scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction.exports.formats.pcd import write_pcd
from spisim.dataset.shots import write_by_scene

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet


def write_clouds(samples: DataSet, folder: Path, shard_size: int = 0) -> list[Path]:
    """Write a folder for each scene, with a cloud for each frame.

    Raises InputError as `write_by_scene`; there are no shards.
    """
    return write_by_scene(samples, folder, write_pcd)


EXPORT = write_clouds
