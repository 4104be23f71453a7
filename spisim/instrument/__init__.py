"""Instruments: pattern projector, lasers, detectors, electronics and timing."""

from spisim.instrument.demodulation import Modulation, Taps
from spisim.instrument.detector import Detector, TofDetector
from spisim.instrument.electronics import Amplifier
from spisim.instrument.model import (
    Instrument,
    embedded_instrument,
    list_presets,
    load_instrument,
    needs,
)
from spisim.instrument.parts import Spectrum
from spisim.instrument.photodiode import Photodiode
from spisim.instrument.sensor import Reading, Readings, Sensor, quantum_efficiency
from spisim.instrument.sensors.apd import Apd
from spisim.instrument.sensors.spad import Spad
from spisim.instrument.tof import Emission, SpotLight, Tof
from spisim.instrument.tofs.cw import CwTof
from spisim.instrument.tofs.dtof import DirectTof

__all__ = [
    "Amplifier",
    "Apd",
    "CwTof",
    "Detector",
    "DirectTof",
    "Emission",
    "Instrument",
    "Modulation",
    "Photodiode",
    "Reading",
    "Readings",
    "Sensor",
    "Spad",
    "Spectrum",
    "SpotLight",
    "Taps",
    "Tof",
    "TofDetector",
    "embedded_instrument",
    "list_presets",
    "load_instrument",
    "needs",
    "quantum_efficiency",
]
