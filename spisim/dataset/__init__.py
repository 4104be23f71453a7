"""Data sets: plan many captures, make them on one machine or a cluster, and read them back.

data = spisim.dataset.open("out/fog")
near = data.where(lambda p: p["scene.fog.visibility_m"] < 50)
train, validation, test = near.split()
"""

from typing import TYPE_CHECKING, Any

from spisim.dataset.exports import EXPORTS
from spisim.dataset.verify import verify

if TYPE_CHECKING:
    from spisim.dataset.packing import pack_dataset
    from spisim.dataset.reader import DataSet
    from spisim.dataset.reader import open_dataset as open  # noqa: A004 - as gzip.open

__all__ = ["EXPORTS", "DataSet", "open", "pack_dataset", "verify"]


def __getattr__(name: str) -> Any:
    """Import on first use: scenes are slow to load, and workers and a status often need none."""
    if name not in __all__:
        raise AttributeError(f"module 'spisim.dataset' has no attribute {name!r}")
    from spisim.dataset.packing import pack_dataset
    from spisim.dataset.reader import DataSet, open_dataset

    return {"DataSet": DataSet, "open": open_dataset, "pack_dataset": pack_dataset}[name]
