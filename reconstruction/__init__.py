"""From a capture, real or simulated, to image, ranges and depth map.

    capture = reconstruction.read_capture("capture.h5")
    result = reconstruction.reconstruct(capture)

Your own patterns (M, H * W), values 0..1, and readings (M,) become an image with sigma:

>>> plan, sign = reconstruction.plan_from_matrix(patterns, (16, 16))
>>> capture = reconstruction.capture_from_readings(sign * readings, plan)
>>> result = reconstruction.reconstruct(capture)
>>> result.image.shape, result.sigma.shape
((16, 16), (16, 16))

Your own taps (4 spots, 4 phases) of an iToF sensor become ranges with sigma:

>>> spots = reconstruction.spots_from_taps(taps, 20e6)
>>> ranges = reconstruction.measure_ranges(spots)
>>> ranges.range_m.round(1), ranges.sigma_m.round(2)
(array([1.5, 2.2, 3.1, 4.4]), array([0.01, 0.01, 0.01, 0.01]))

Your own histograms (4 spots, bins) of 1 ns, of 10,000 pulses, become ranges:

>>> spots = reconstruction.spots_from_histograms(histograms, 1e-9, 10_000)
>>> reconstruction.measure_ranges(spots).range_m.round(1)
array([1.5, 3. , 4.5, 6. ])

Your own denoiser becomes an image method, beside those by name:

>>> smooth = reconstruction.denoiser(lambda image, sigma: gaussian_filter(image, 1), "smooth")
>>> list(reconstruction.reconstruct(capture, image=[smooth, "pursuit"]).images)
['smooth', 'pursuit', 'zero-filled']

A thousand frames of readings (1000, M) take one call, and share everything but the readings:

>>> capture = reconstruction.capture_from_readings(sign * many_readings, plan)
>>> reconstructor = reconstruction.Reconstructor(capture.setup, image="least-squares")
>>> len(reconstructor.batch(capture.batch(0, 1000)))
1000
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
    from .capture.importers import (
        capture_from_readings,
        plan_from_matrix,
        spots_from_histograms,
        spots_from_taps,
    )
    from .chosen_methods import denoiser, register
    from .diagnostics import capture_warnings
    from .evaluation import evaluate
    from .operators import PatternPlan, make_plan
    from .outputs import read_result, write_outputs
    from .ranging import measure_ranges
    from .reconstructor import Reconstructor, reconstruct
    from .result import Result

__version__ = "0.1.0"

logging.getLogger(__name__).addHandler(logging.NullHandler())

__all__ = [
    "Capture", "Frames", "InputError", "PatternPlan", "Reconstructor", "Result", "Setup",
    "capture_from_readings", "capture_warnings", "denoiser", "evaluate", "first_patterns",
    "make_plan", "measure_ranges", "open_capture", "plan_from_matrix", "read_capture",
    "read_result", "reconstruct", "register", "spots_from_histograms", "spots_from_taps",
    "write_capture", "write_outputs",
]  # fmt: skip

_NAMES = {
    "base.errors": "InputError",
    "capture": "Capture Frames Setup first_patterns open_capture read_capture write_capture",
    "capture.importers": "capture_from_readings plan_from_matrix spots_from_histograms "
    "spots_from_taps",
    "chosen_methods": "denoiser register",
    "diagnostics": "capture_warnings",
    "evaluation": "evaluate",
    "operators": "PatternPlan make_plan",
    "outputs": "read_result write_outputs",
    "ranging": "measure_ranges",
    "reconstructor": "Reconstructor reconstruct",
    "result": "Result",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    """Import on first use, so that a rig loads no more than it needs."""
    if name not in _MODULES:
        raise AttributeError(f"module 'reconstruction' has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """The public names, imported or not."""
    return sorted(__all__)
