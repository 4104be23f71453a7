"""From a capture, real or simulated, to image, ranges and depth map.

    import reconstruction

    capture = reconstruction.read_capture("capture.h5")
    result = reconstruction.reconstruct(capture)

Of many frames, or where every millisecond counts, `Reconstructor` does once what they share.
"""

import logging
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .base.errors import InputError
    from .capture import (
        Capture,
        Frames,
        Setup,
        first_patterns,
        open_capture,
        read_capture,
        write_capture,
    )
    from .diagnostics import capture_warnings
    from .evaluation import evaluate
    from .operators import PatternPlan, make_plan
    from .outputs import read_result, write_outputs
    from .reconstructor import Reconstructor, reconstruct
    from .result import Result

__version__ = "0.1.0"

logging.getLogger(__name__).addHandler(logging.NullHandler())

_HOMES = {
    "Capture": "capture",
    "Frames": "capture",
    "InputError": "base.errors",
    "PatternPlan": "operators",
    "Reconstructor": "reconstructor",
    "Result": "result",
    "Setup": "capture",
    "capture_warnings": "diagnostics",
    "evaluate": "evaluation",
    "first_patterns": "capture",
    "make_plan": "operators",
    "open_capture": "capture",
    "read_capture": "capture",
    "read_result": "outputs",
    "reconstruct": "reconstructor",
    "write_capture": "capture",
    "write_outputs": "outputs",
}

__all__ = [
    "Capture",
    "Frames",
    "InputError",
    "PatternPlan",
    "Reconstructor",
    "Result",
    "Setup",
    "capture_warnings",
    "evaluate",
    "first_patterns",
    "make_plan",
    "open_capture",
    "read_capture",
    "read_result",
    "reconstruct",
    "write_capture",
    "write_outputs",
]


def __getattr__(name: str) -> Any:
    """Import on first use, so that a rig loads no more than it needs."""
    if name not in _HOMES:
        raise AttributeError(f"module 'reconstruction' has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    """The public names, imported or not."""
    return sorted(__all__)
