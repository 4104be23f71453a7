"""Adapter for DeepInverse (https://deepinv.github.io)."""

from typing import Any

import deepinv
import torch

from ..operators import MeasurementOperator


def linear_physics(operator: MeasurementOperator, noise: float = 0.0) -> Any:
    """`deepinv.physics.LinearPhysics` from images (B, 1, H, W) to coefficients (B, K).

    Coefficients, measured ones too, are divided by the rows' length, so that the operator has norm
    1, and have Gaussian noise of standard deviation ``noise``. Complex ones are not supported.
    """
    length = operator.row_length

    def forward(images: Any, **_: Any) -> Any:
        seen = operator.forward(images[:, 0].detach().cpu().numpy()) / length
        return torch.as_tensor(seen, dtype=images.dtype, device=images.device)

    def back(coefficients: Any, **_: Any) -> Any:
        result = operator.back_project(coefficients.detach().cpu().numpy())[:, None] / length
        return torch.as_tensor(result, dtype=coefficients.dtype, device=coefficients.device)

    return deepinv.physics.LinearPhysics(
        A=forward,
        A_adjoint=back,
        noise_model=deepinv.physics.GaussianNoise(noise),
        img_size=(1, *operator.image_shape),
    )
