"""A data set as tensors; needs PyTorch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import Dataset

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet


class Tensors(Dataset[dict[str, torch.Tensor]]):
    """Named arrays of every sample, read when asked for; workers may have copies of it."""

    def __init__(self, samples: DataSet, names: tuple[str, ...]) -> None:
        self.samples = samples
        self.names = names

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, place: int) -> dict[str, torch.Tensor]:
        sample = self.samples[place]
        tensors = {name: as_tensor(sample.array(name)) for name in self.names}
        return tensors | {"index": torch.tensor(sample.index)}


def as_tensor(values: NDArray[Any]) -> torch.Tensor:
    """A copy; masks stay masks, all else becomes float32."""
    return torch.from_numpy(values.astype(bool if values.dtype == bool else np.float32))
