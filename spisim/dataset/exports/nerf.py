"""Images with poses and `transforms.json`, of the samples of each scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction.exports.formats.nerf import write_nerf
from spisim.dataset.shots import write_by_scene

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet


def write_views(samples: DataSet, folder: Path, shard_size: int = 0) -> list[Path]:
    """Write a folder for each scene, which a plan with `poses` sees from several places.

    Depth is the true one. Raises InputError as `write_by_scene`; there are no shards.
    """
    return write_by_scene(samples, folder, write_nerf)


EXPORT = write_views
