"""Questions about an instrument that data sheets answer, with defaults and units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from reconstruction.base.errors import InputError, nearest

#: Parts of an instrument.
IMAGE, RANGES, BOTH = "image", "ranges", "both"
METHODS = "cw", "pulsed", "dtof"
#: Default detector of each method of time of flight.
USUAL_PARTS = {"dtof": "ingaas-spad"}


class Question(NamedTuple):
    """A question with its text, default, minimum and maximum."""

    text: str
    default: float | int | str
    low: float = 0.0
    high: float = math.inf
    of: str = BOTH

    def asked(self, answers: Mapping[str, Any]) -> bool:
        """Whether it applies to an instrument with these answers."""
        return self.of == BOTH or answers["makes"] in (BOTH, self.of)

    def checked(self, name: str, answer: Any) -> float | int | str:
        """Return the answer in the type of the default. Raises InputError if it is not allowed."""
        if isinstance(self.default, str):
            allowed = _allowed(name)
            if str(answer) not in allowed:
                raise InputError(f"{name} {str(answer)!r}: {nearest(str(answer), allowed)}")
            return str(answer)
        kind = type(self.default)
        try:
            value = kind(answer)
        except ValueError:
            value = kind(0)
            wrong = True
        else:
            wrong = not self.low <= value <= self.high
        if wrong:
            what = "whole number" if kind is int else "number"
            in_mhz = name == "frequency_hz" and 0 < value < self.low
            hint = f"; if it is in MHz, write {value:g}e6" if in_mhz else ""
            raise InputError(f"{name} {answer}: a {what} from {self.low:g} to {self.high:g}{hint}")
        return value


QUESTIONS: dict[str, Question] = {
    "makes": Question("What it makes: image, ranges or both", BOTH),
    "wavelength_nm": Question("Wavelength of the light", 1550.0, 800, 1600),
    "filter_width_nm": Question("Width of the band-pass in front of the detectors", 12.0, 0.1, 500),
    "pixels": Question("Rows and columns of the patterns, a power of two", 64, 2, 1024, IMAGE),
    "field_deg": Question("Full angle of the lit field", 20.0, 0.1, 150),
    "array_power_w": Question("Radiant power of the LED array, all on", 6.4, 1e-6, 1e4, IMAGE),
    "array_fwhm_nm": Question("Width of its spectrum", 110.0, 0.1, 500, IMAGE),
    "pattern_rate_hz": Question("Patterns per second", 15e3, 1, 1e8, IMAGE),
    "patterns": Question("Patterns of a frame", 127, 1, 2**20, IMAGE),
    "image_part": Question("Detector of the image, by part", "fga015", of=IMAGE),
    "image_adc_bits": Question("Bits of its converter", 16, 1, 31, IMAGE),
    "spots": Question("Laser spots", 4, 1, 64, RANGES),
    "laser_power_w": Question("Power of a laser, of a pulse its peak", 5e-3, 1e-9, 1e4, RANGES),
    "modulation": Question("Time of flight: cw, pulsed or dtof", "cw", of=RANGES),
    "frequency_hz": Question("Modulation frequency of cw", 15e6, 1e4, 1e10, RANGES),
    "pulse_s": Question("Pulse width of pulsed and dtof", 1e-8, 1e-12, 1e-3, RANGES),
    "frame_time_s": Question("Time of a frame of ranges alone", 0.01, 1e-6, 100, RANGES),
    "range_part": Question("Detector of the spots, by part", "fga015", of=RANGES),
    "range_adc_bits": Question("Bits of their converters", 14, 1, 31, RANGES),
}


@cache
def detector_parts() -> dict[str, dict[str, Any]]:
    """Return sensors of instrument files by part."""
    from spisim.base.config import load_yaml, read_text
    from spisim.instrument.model import DETECTOR_PARTS

    parts: dict[str, dict[str, Any]] = load_yaml(read_text(DETECTOR_PARTS), DETECTOR_PARTS)
    return parts


def _allowed(name: str) -> list[str]:
    if name.endswith("part"):
        return list(detector_parts())
    return [IMAGE, RANGES, BOTH] if name == "makes" else [*METHODS]


def default_of(name: str, answers: Mapping[str, Any]) -> float | int | str:
    """Return the default of a question, given the answers before it."""
    if name == "range_part":
        return USUAL_PARTS.get(answers["modulation"], QUESTIONS[name].default)
    return QUESTIONS[name].default


def is_asked(name: str, answers: Mapping[str, Any]) -> bool:
    """Return whether a question applies to an instrument with these answers."""
    if not QUESTIONS[name].asked(answers):
        return False
    if name in ("frequency_hz", "pulse_s"):
        return bool((answers["modulation"] == "cw") == (name == "frequency_hz"))
    if name.endswith("adc_bits"):
        part = detector_parts()[answers[name.replace("adc_bits", "part")]]
        return bool(part["sensor"]["type"] != "spad")
    return name != "frame_time_s" or answers["makes"] == RANGES


def completed(answers: Mapping[str, Any]) -> dict[str, Any]:
    """Return answers to all applicable questions: given ones, and defaults.

    Raises InputError for an answer that is not allowed or does not apply.
    """
    available: dict[str, Any] = {}
    for name, question in QUESTIONS.items():
        given = answers.get(name)
        if is_asked(name, available):
            answer = default_of(name, available) if given is None else given
            available[name] = question.checked(name, answer)
        elif given is not None:
            raise InputError(
                f"{name} {given}: does not apply to an instrument that {_described(available)}"
            )
    return available


def _described(given: Mapping[str, Any]) -> str:
    made = {IMAGE: "makes an image alone", RANGES: "makes ranges alone", BOTH: "makes both"}
    names = [name for name in ("modulation", "image_part", "range_part") if name in given]
    parts = ", ".join(str(given[name]) for name in names)
    return f"{made[given['makes']]}{', with ' if parts else ''}{parts}"
