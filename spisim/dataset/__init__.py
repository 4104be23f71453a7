"""Data sets: plan many captures, make them on one machine or a cluster, and read them back.

data = spisim.dataset.open("out/fog")
near = data.where(lambda p: p["scene.fog.visibility_m"] < 50)
train, validation, test = near.split()
"""

from spisim.dataset.exports import EXPORTS
from spisim.dataset.packing import pack_dataset
from spisim.dataset.reader import DataSet
from spisim.dataset.reader import open_dataset as open  # noqa: A004 - as gzip.open
from spisim.dataset.verify import verify

__all__ = ["EXPORTS", "DataSet", "open", "pack_dataset", "verify"]
