"""For SPyRiT (https://spyrit.readthedocs.io)."""

from typing import Any

import numpy as np
import spyrit.core.meas
import spyrit.core.noise
import torch

from ..operators import MeasurementOperator


def linear(operator: MeasurementOperator, noise: float = 0.0) -> Any:
    """A `spyrit.core.meas.Linear` from images (..., H, W) to coefficients (..., K).

    It holds all rows as a matrix, of the precision that is PyTorch's default. Coefficients are
    divided by the rows' length, so that the rows are orthonormal, and have Gaussian noise of this
    standard deviation; so must measured ones. Complex ones have no place.
    """
    rows = operator.back_project(np.eye(operator.shape[0])) / operator.row_length
    return spyrit.core.meas.Linear(
        torch.as_tensor(rows.reshape(operator.shape)),
        meas_shape=operator.image_shape,
        noise_model=spyrit.core.noise.Gaussian(noise) if noise else torch.nn.Identity(),
        dtype=torch.get_default_dtype(),
    )
