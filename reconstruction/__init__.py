"""From a capture, real or simulated, to image, ranges and depth map."""

from .capture import Capture, read_capture, write_capture
from .errors import InputError
from .evaluation import evaluate
from .findings import capture_warnings
from .outputs import read_result, write_outputs
from .patterns import PatternPlan, make_plan
from .pipeline import Result, reconstruct
from .selection import first_patterns

__all__ = [
    "Capture",
    "InputError",
    "PatternPlan",
    "Result",
    "capture_warnings",
    "evaluate",
    "first_patterns",
    "make_plan",
    "read_capture",
    "read_result",
    "reconstruct",
    "write_capture",
    "write_outputs",
]
