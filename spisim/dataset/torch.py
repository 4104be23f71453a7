"""A data set as PyTorch tensors."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset


class Tensors(Dataset[dict[str, torch.Tensor]]):
    """Named arrays of each sample, read on access; every worker may hold a copy."""

    def __init__(self, rows: Sequence[Mapping[str, NDArray[Any]]]) -> None:
        self.rows = rows

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, position: int) -> dict[str, torch.Tensor]:
        row = dict(self.rows[position])
        index = torch.tensor(int(row.pop("index")))
        return {name: _tensor(values) for name, values in row.items()} | {"index": index}


def _tensor(values: NDArray[Any]) -> torch.Tensor:
    """Copy an array: masks stay boolean, everything else becomes float32."""
    return torch.from_numpy(np.array(values, bool if values.dtype == bool else np.float32))
