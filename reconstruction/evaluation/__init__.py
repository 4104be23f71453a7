"""Quality of a result, against the truth of a simulation or by repeated frames."""

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
