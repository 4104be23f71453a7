"""Captures along a flight, reused if they exist."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction import Capture, InputError, read_capture
from spisim.base.config import load_yaml
from spisim.instrument import Instrument
from spisim.scene import Scene, Trajectory, at_drone_state

MAX_CAPTURES = 100_000


@dataclass(frozen=True, eq=False)
class Instant:
    """One capture of a flight: its number, time, scene and seed."""

    number: int
    time_s: float
    scene: Scene
    seed: int

    @property
    def file(self) -> str:
        """File name of the capture."""
        return f"capture-{self.number:04d}.h5"


def instants(
    scene: Scene, trajectory: Trajectory, instrument: Instrument, rate_hz: float, seed: int
) -> list[Instant]:
    """Return the captures of a flight at `rate_hz`, starting with the flight.

    Raises InputError for a rate at which frames overlap, and for more than `MAX_CAPTURES`.
    """
    frame_s = instrument.frame_time_s
    if rate_hz * frame_s > 1:
        raise InputError(
            f"{rate_hz:g} captures per second overlap, because a frame of this instrument takes "
            f"{frame_s:.4g} s; at most {1 / frame_s:.4g}"
        )
    count = int(np.floor(trajectory.duration_s * rate_hz * (1 + 1e-12))) + 1
    if count > MAX_CAPTURES:
        raise InputError(
            f"a flight of {trajectory.duration_s:.4g} s has {count:.4g} captures at {rate_hz:g} "
            f"per second; at most {MAX_CAPTURES:,}: shorten the flight or lower the rate"
        )
    times = np.minimum(np.arange(count) / rate_hz, trajectory.duration_s).tolist()
    return [
        Instant(
            number, time_s, at_drone_state(scene, trajectory.drone_state(time_s)), seed + number
        )
        for number, time_s in enumerate(times)
    ]


def existing_captures(
    folder: Path, flight: list[Instant], instrument: Instrument, light: Mapping[str, Any]
) -> set[int]:
    """Return the numbers of captures of this very flight that a folder already holds.

    `light` are the arguments of `simulate`. Raises InputError for captures of another flight,
    scene, instrument, seed, source of light, or budget if light is traced.
    """
    files = {folder / instant.file: instant for instant in flight}
    strangers = sorted(set(folder.glob("capture-*.h5")) - set(files))
    if strangers:
        raise InputError(f"{strangers[0]} is not of this flight; use another folder")
    settings = {"noise": True, "frames": 1}
    traced = light["light"] == "traced"
    if traced:
        settings |= {name: value for name, value in light.items() if name != "light"}
    existing = set()
    for file, instant in files.items():
        if not file.exists():
            continue
        if different := _difference(read_capture(file), instant, instrument, settings, traced):
            raise InputError(
                f"{file} was made with another {different}; use another folder, or remove it"
            )
        existing.add(instant.number)
    return existing


def _difference(
    capture: Capture,
    instant: Instant,
    instrument: Instrument,
    settings: Mapping[str, Any],
    traced: bool,
) -> str | None:
    """Return what an existing capture was made with that this instant differs in, or None."""
    made = capture.provenance
    if made.source != "simulation" or made.scene != instant.scene.text:
        return "scene or flight"
    if made.instrument != instrument.text:
        return "instrument"
    if made.seed != instant.seed:
        return "seed"
    if made.is_surrogate == traced:
        return "light"
    stored = load_yaml(made.settings, "settings")
    stored = stored if isinstance(stored, dict) else {}
    for field, value in settings.items():
        if stored.get(field) != value:
            return field
    return None
