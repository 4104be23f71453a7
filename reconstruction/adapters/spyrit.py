"""Adapter for SPyRiT (https://spyrit.readthedocs.io)."""

from typing import Any

import numpy as np
import spyrit.core.meas
import spyrit.core.noise
import torch

from ..operators import MeasurementOperator


def linear(operator: MeasurementOperator, noise: float = 0.0) -> Any:
    """`spyrit.core.meas.Linear` from images (..., H, W) to coefficients (..., K).

    It stores all rows as a matrix in PyTorch's default precision. Coefficients, measured ones too,
    are divided by the rows' length, so that the rows are orthonormal, and have Gaussian noise of
    standard deviation ``noise``. Complex ones are not supported.
    """
    rows = operator.back_project(np.eye(operator.shape[0])) / operator.row_length
    return spyrit.core.meas.Linear(
        torch.as_tensor(rows.reshape(operator.shape)),
        meas_shape=operator.image_shape,
        noise_model=spyrit.core.noise.Gaussian(noise) if noise else torch.nn.Identity(),
        dtype=torch.get_default_dtype(),
    )
