"""What the drone carries: pattern projector, lasers, detectors, electronics, timing."""

from spisim.instrument.demodulation import Modulation, Taps
from spisim.instrument.detector import Adc, Amplifier, BucketDetector, Detector, TofDetector
from spisim.instrument.load import list_presets, load_instrument
from spisim.instrument.model import EyeSafety, Instrument
from spisim.instrument.needs import needs
from spisim.instrument.parts import Filter, Lasers, Plan, Projector, Spectrum
from spisim.instrument.photodiode import Photodiode
from spisim.instrument.sensor import Readings, Sensor, quantum_efficiency
from spisim.instrument.sensors import SENSORS
from spisim.instrument.sensors.apd import Apd
from spisim.instrument.sensors.pin import Pin
from spisim.instrument.sensors.spad import Spad
from spisim.instrument.tof import Emission, Reading, SpotLight, Tof
from spisim.instrument.tofs import TOFS
from spisim.instrument.tofs.cw import CwTof
from spisim.instrument.tofs.dtof import DirectTof
from spisim.instrument.tofs.pulsed import PulsedTof

__all__ = [
    "SENSORS",
    "TOFS",
    "Adc",
    "Amplifier",
    "Apd",
    "BucketDetector",
    "CwTof",
    "Detector",
    "DirectTof",
    "Emission",
    "EyeSafety",
    "Filter",
    "Instrument",
    "Lasers",
    "Modulation",
    "Photodiode",
    "Pin",
    "Plan",
    "Projector",
    "PulsedTof",
    "Reading",
    "Readings",
    "Sensor",
    "Spad",
    "Spectrum",
    "SpotLight",
    "Taps",
    "Tof",
    "TofDetector",
    "list_presets",
    "load_instrument",
    "needs",
    "quantum_efficiency",
]
