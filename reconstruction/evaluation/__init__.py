"""Quality of a result, against the truth of a simulation or by repeated frames."""

from .depths import depth_metrics
from .flights import evaluate_flight, is_flight
from .methods import METHODS, method_title, no_range
from .metrics import evaluate, image_metrics
from .recordings import evaluate_recording

__all__ = [
    "METHODS",
    "depth_metrics",
    "evaluate",
    "evaluate_flight",
    "evaluate_recording",
    "image_metrics",
    "is_flight",
    "method_title",
    "no_range",
]
