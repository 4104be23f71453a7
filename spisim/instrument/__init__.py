"""What the drone carries: pattern projector, lasers, detectors, electronics, timing."""

from spisim.instrument.demodulation import Modulation, Taps
from spisim.instrument.detector import Adc, Amplifier, BucketDetector, Detector, TofDetector
from spisim.instrument.load import list_presets, load_instrument
from spisim.instrument.model import EyeSafety, Instrument
from spisim.instrument.needs import needs
from spisim.instrument.parts import Filter, Lasers, Plan, Projector, Spectrum
from spisim.instrument.sensor import Apd, Pin, Sensor, Spad, quantum_efficiency
from spisim.instrument.tof import CwTof, DirectTof, PulsedTof, Tof

__all__ = [
    "Adc",
    "Amplifier",
    "Apd",
    "BucketDetector",
    "CwTof",
    "Detector",
    "DirectTof",
    "EyeSafety",
    "Filter",
    "Instrument",
    "Lasers",
    "Modulation",
    "Pin",
    "Plan",
    "Projector",
    "PulsedTof",
    "Sensor",
    "Spad",
    "Spectrum",
    "Taps",
    "Tof",
    "TofDetector",
    "list_presets",
    "load_instrument",
    "needs",
    "quantum_efficiency",
]
