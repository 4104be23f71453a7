"""How good a result is, against the truth that a simulation knows."""

from .metrics import depth_metrics, evaluate, image_metrics

__all__ = ["depth_metrics", "evaluate", "image_metrics"]
