"""A data set as tensors; needs PyTorch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
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
        tensors = {
            name: torch.from_numpy(np.array(sample.array(name), np.float32)) for name in self.names
        }
        return tensors | {"index": torch.tensor(sample.index)}
