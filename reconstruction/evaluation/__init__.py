"""How good a result is, against the truth that a simulation knows."""

from .depths import depth_metrics
from .methods import METHODS, method_title
from .metrics import evaluate, image_metrics
from .words import no_range

__all__ = ["METHODS", "depth_metrics", "evaluate", "image_metrics", "method_title", "no_range"]
