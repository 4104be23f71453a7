"""One RGB-D sequence, TUM's and Redwood's layout, of the samples of each scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction.exports.formats.rgbd import write_rgbd
from spisim.dataset.shots import write_by_scene

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet


def write_sequences(samples: DataSet, folder: Path, shard_size: int = 0) -> list[Path]:
    """Write a folder for each scene, with a frame a second where samples know no time.

    Depth is the true one. Raises InputError as `write_by_scene`; there are no shards.
    """
    return write_by_scene(samples, folder, write_rgbd)


EXPORT = write_sequences
