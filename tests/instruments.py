"""Instruments with one thing changed, shared by the tests."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from spisim.budget.equations import Flood
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.model import PRESETS

PER_SPOT = (
    *("directions", "detector_positions_m", "detector_axes"),
    *("half_fields_rad", "falloffs", "aperture_radii_m"),
)
#: Changes of a pulsed instrument: six short windows and a narrow field.
WINDOWS = {
    "lasers__power_w": 0.03,
    "tof__pulse_width_s": 10e-9,
    "tof__rise_time_s": 0.0,
    "tof__windows": 6,
    "tof__detector__field_of_view_deg": 0.6,
}
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


def write_small(folder: Path) -> None:
    """The paper's instrument with 16 × 16 pixels, as small.yaml."""
    fields = yaml.safe_load(load_instrument("paper").text)
    fields["projector"]["shape"] = [16, 16]
    fields["plan"]["patterns"] = 63
    (folder / "small.yaml").write_text(yaml.safe_dump(fields))


def flood(power_w: float, half_angle_deg: float, noise: float = 2e-12) -> Flood:
    return Flood.of(
        load_instrument("paper"),
        power_w=power_w,
        half_angle_deg=half_angle_deg,
        illuminance_klx=100,
        noise_a_per_sqrt_hz=noise,
    )


def of_spots(name: str, spots: int, **changes: Any) -> Instrument:
    """A preset with another number of spots, on a grid, each with a detector 1 cm beside it."""
    side = int(np.ceil(np.sqrt(spots)))
    across = np.linspace(-5, 5, side) if side > 1 else np.array([3.0])
    directions = [[float(x), float(y)] for y in across for x in across][:spots]
    positions = [[0.00707 * (-1) ** (x < 0), -0.00707 * (-1) ** (y < 0), 0] for x, y in directions]
    return changed(
        name,
        lasers__directions_deg=directions,
        tof__detector__positions_m=positions,
        **changes,
    )


def some_of(spots, order):
    """Some spots of a continuous-wave recording, in this order."""
    per_spot = {name: getattr(spots, name)[order] for name in PER_SPOT}
    readings = {name: getattr(spots, name)[:, order] for name in ("taps", "saturated")}
    return replace(spots, **per_spot, **readings)
