"""Instrument files from data sheets, with converters scaled to a white wall."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from spisim.base.config import parse_model
from spisim.budget import Target, bucket_link, spot_link
from spisim.instrument import Instrument

from .sheet_text import instrument_text

#: The brightest target of the converters: a near white wall in the sun.
BRIGHTEST = Target(1.0, reflectance=1.0, illuminance_klx=100.0)
#: Fraction of the range; the rest is for noise and offset.
HEADROOM = 1.1


def new_instrument_text(answers: Mapping[str, Any], source: str = "instrument") -> str:
    """Return the commented YAML of an instrument from answers (`data_sheet.completed`).

    Raises InputError, naming ``source``, for answers that contradict each other.
    """
    draft = parse_model(instrument_text(answers), Instrument, source)
    text = instrument_text(answers, _full_scale(draft))
    parse_model(text, Instrument, source)
    return text


def _full_scale(instrument: Instrument) -> dict[str, float]:
    """Return primary electrons of the brightest reading of each detector, to two digits."""
    scales = {}
    if instrument.images:
        link = bucket_link(instrument, BRIGHTEST)
        light = link.signal_electrons + link.daylight_electrons + link.dark_electrons
        scales["detector"] = float(light)
    if instrument.ranges:
        spots, time_s = spot_link(instrument, BRIGHTEST), instrument.ranging.tof.reading.steady_s
        peak_per_s = (
            2 * spots.echo_per_s + spots.steady_per_s
        )  # a tap in phase collects twice the mean
        scales["tof.detector"] = float(peak_per_s.max() * time_s)
    return {name: _rounded_up(HEADROOM * light) for name, light in scales.items()}


def _rounded_up(value: float) -> float:
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / digit) * digit
