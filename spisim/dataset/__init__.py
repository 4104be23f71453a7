"""Data sets: plan many captures, make them on one machine or a cluster, and read them back.

data = spisim.dataset.open("out/fog")
near = data.where(lambda p: p["scene.fog.visibility_m"] < 50)
train, validation, test = near.split()
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from spisim.dataset.exports import EXPORTS
from spisim.dataset.verify import verify

if TYPE_CHECKING:
    from spisim.dataset.packing import pack_dataset
    from spisim.dataset.reader import DataSet
    from spisim.dataset.reader import open_dataset as open  # noqa: A004 - as gzip.open

__all__ = ["EXPORTS", "DataSet", "open", "pack_dataset", "verify"]

_HOMES = {
    "DataSet": "reader:DataSet",
    "open": "reader:open_dataset",
    "pack_dataset": "packing:pack_dataset",
}


def __getattr__(name: str) -> Any:
    """Import on first use: scenes are slow to load, and workers and a status often need none."""
    if name not in _HOMES:
        raise AttributeError(f"module 'spisim.dataset' has no attribute {name!r}")
    module, _, original = _HOMES[name].partition(":")
    return getattr(import_module(f"spisim.dataset.{module}"), original)
