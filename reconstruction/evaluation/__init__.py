"""How good a result is, against the truth that a simulation knows, or by what frames repeat."""

from .depths import depth_metrics
from .methods import METHODS, method_title, no_range
from .metrics import evaluate, image_metrics
from .recordings import evaluate_recording

__all__ = [
    "METHODS",
    "depth_metrics",
    "evaluate",
    "evaluate_recording",
    "image_metrics",
    "method_title",
    "no_range",
]
