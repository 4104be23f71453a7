"""What the drone carries: pattern projector, lasers, detectors, electronics, timing."""

from spisim.instrument.load import list_presets, load_instrument
from spisim.instrument.model import Instrument
from spisim.instrument.parts import (
    Adc,
    BucketDetector,
    Detector,
    Filter,
    Lasers,
    Plan,
    Projector,
    Tof,
    TofDetector,
)

__all__ = [
    "Adc",
    "BucketDetector",
    "Detector",
    "Filter",
    "Instrument",
    "Lasers",
    "Plan",
    "Projector",
    "Tof",
    "TofDetector",
    "list_presets",
    "load_instrument",
]
