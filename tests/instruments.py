"""Instruments with one thing changed, shared by the tests."""

from pathlib import Path
from typing import Any

import yaml

from spisim.budget.equations import Flood
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.model import PRESETS

PAPER = (PRESETS / "paper.yaml").read_text(encoding="utf-8")


def load_text(folder: Path, text: str) -> Instrument:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return load_instrument(path)


def changed(name: str, **changes: Any) -> Instrument:
    """A preset with other fields, told by their path: `tof__pulses=1000`."""
    fields = yaml.safe_load(load_instrument(name).text)
    for path, value in changes.items():
        *parents, last = path.split("__")
        section = fields
        for parent in parents:
            section = section[parent]
        section[last] = value
    return Instrument.model_validate(fields)


def flood(power_w: float, half_angle_deg: float, noise: float = 2e-12) -> Flood:
    return Flood.of(
        load_instrument("paper"),
        power_w=power_w,
        half_angle_deg=half_angle_deg,
        illuminance_klx=100,
        noise_a_per_sqrt_hz=noise,
    )
