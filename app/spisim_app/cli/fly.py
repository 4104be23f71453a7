"""`spisim fly`: a flight through a scene, capture by capture or as one recording."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconstruction.base.errors import InputError, naming

from . import options as opt
from .console import print_json, progress_bar, say, warn
from .inputs import instrument_with, scene_with
from .outputs import files_read, resumed
from .outputs import output as named
from .weather_options import OWN_WEATHER_OF_DROPS, WeatherOfDrops

if TYPE_CHECKING:
    from collections.abc import Callable

    from spisim.dataset.flight import Instant
    from spisim.instrument import Instrument
    from spisim.scene import Scene, Trajectory
    from spisim.simulation.flight import PoseError
    from spisim_app.report.flight import EvaluatedFrame

EVERY = "frames"
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
EXAMPLE = "spisim fly warehouse --path warehouse-flight -o out/flight --spp 64"


@dataclass(frozen=True)
class RecordingOptions:
    """One recording of every frame."""

    truths: Annotated[
        int, opt.number_option(1, 10**6, "Record the truth of every Nth frame (--rate frames).")
    ] = 1
    spacing: Annotated[
        float,
        opt.real_option(
            "Distance between key poses, where light is solved (--rate frames).",
            minimum=0.001,
            maximum=1,
            metavar="M",
        ),
    ] = 0.05
    pose_error: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=X,...",
            help="Errors of recorded poses: white_m, white_deg, correlated_m, correlated_deg, "
            "correlation_s, drift_m_per_sqrt_s, drift_deg_per_sqrt_s, delay_s (--rate frames).",
        ),
    ] = None

    @property
    def error_model(self) -> PoseError:
        """The errors; InputError for unknown names and impossible values."""
        from spisim.base.config import check_fields
        from spisim.simulation.flight import PoseError

        if self.pose_error is None:
            return PoseError()
        fields: dict[str, float] = {}
        for part in self.pose_error.split(","):
            name, _, value = part.partition("=")
            if not NUMBER.fullmatch(value.strip()):
                raise InputError(f"--pose-error {part!r}: must be NAME=X,NAME=X,..., X a number")
            if name.strip() in fields:
                raise InputError(f"--pose-error {name.strip()} is given twice")
            fields[name.strip()] = float(value)
        return check_fields(fields, PoseError, "--pose-error")


EVERY_FRAME = RecordingOptions()


@opt.with_options
def command(
    scene: opt.SceneArgument,
    path: Annotated[
        str, typer.Option("--path", metavar="FILE", help="Poses or way-points: CSV or TUM.")
    ],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="OUT", help="A folder; a file of --rate frames."),
    ],
    instrument: opt.InstrumentOption = "paper",
    frame: Annotated[
        str, typer.Option(help="What quaternions of the path turn: body or optical.")
    ] = "body",
    rate: Annotated[
        str, typer.Option(metavar="HZ|frames", help="Captures per second, or every frame.")
    ] = "2",
    speed: Annotated[
        float, opt.real_option("Fly the path X times as fast.", minimum=0.01, maximum=100)
    ] = 1.0,
    weather: WeatherOfDrops = OWN_WEATHER_OF_DROPS,
    stated: opt.StatedWeather = None,
    seed: opt.Seed = 0,
    light: opt.LightOptions = opt.TRACED_OR_SURROGATE,
    recording: RecordingOptions = EVERY_FRAME,
    run: opt.RunOptions = opt.RUN,
) -> None:
    """Fly a path: one capture per instant with the drone's motion, then its image and depth.

    Writes capture-0000.h5 and so on, a page, an animation and a table. With --rate frames it writes
    one recording of all frames with their poses instead. An interrupted flight continues.
    """
    from spisim.scene import load_trajectory

    def load() -> Flight:
        trajectory = load_trajectory(path, frame).faster(speed)
        carried = instrument_with(instrument, stated=stated or trajectory.weather)
        loaded, oddities = scene_with(scene, carried.wavelength_nm, weather)
        return Flight(loaded, trajectory, carried, oddities, seed, light.arguments)

    read = list(files_read(scene, instrument, path))
    if rate == EVERY:
        _record_all(load, output, read, recording, run)
        return
    per_s = _captures_per_s(rate)
    if recording != EVERY_FRAME:
        raise InputError("--truths, --spacing and --pose-error go with --rate frames")
    _record_captures(load, output, read, per_s, run)


@dataclass(frozen=True, eq=False)
class Flight:
    """Where to fly, with what, and how light is solved."""

    scene: Scene
    path: Trajectory
    instrument: Instrument
    oddities: list[str]
    seed: int
    light: dict[str, Any]


def _captures_per_s(rate: str) -> float:
    try:
        value = float(rate)
    except ValueError:
        value = float("nan")
    if not 0.01 <= value <= 1e4:
        raise InputError(f"--rate {rate}: must be {EVERY}, or a number from 0.01 to 10000")
    return value


def _record_all(
    load: Callable[[], Flight],
    output: Path,
    read: list[Path],
    options: RecordingOptions,
    run: opt.RunOptions,
) -> None:
    """Record every frame in one file."""
    from reconstruction.base.folders import output_files
    from spisim.simulation.flight import record_flight

    file = named(output, "simulated capture")
    with output_files([file], read, overwrite=run.overwrite):
        error = options.error_model
        with resumed(), progress_bar("Flying", run.progress) as advance:
            flight = load()
            frames, kept = record_flight(
                output,
                flight.scene,
                flight.path,
                flight.instrument,
                seed=flight.seed,
                truths=options.truths,
                spacing_m=options.spacing,
                pose_error=error,
                progress=advance,
                **flight.light,
            )
        if run.json:
            report = {"written": [output], "frames": frames, "kept": kept}
            print_json(report | {"duration_s": flight.path.duration_s, "warnings": flight.oddities})
            return
        old = f" ({kept} of them kept)" if kept else ""
        say(f"Wrote {frames} frames{old} to {output}.")
        say(f"Next: spisim reconstruct {output} -o {output.with_suffix('')}")


def _record_captures(
    load: Callable[[], Flight], output: Path, read: list[Path], rate: float, run: opt.RunOptions
) -> None:
    """Simulate a capture per instant, and show what is made of them."""
    from reconstruction.base.files import remove_unfinished
    from reconstruction.base.folders import output_folder
    from spisim.dataset.flight import existing_captures, instants
    from spisim.scene import check_clear_path
    from spisim_app.report.flight import flight_outputs, write_animation, write_table
    from spisim_app.report.flight_page import write_flight

    files = flight_outputs(output)
    animation, page, table = (file.path for file in files)
    with output_folder(output, files, read, overwrite=run.overwrite), resumed():
        flown = load()
        loaded, oddities = flown.scene, flown.oddities
        check_clear_path(loaded, flown.path)
        flight = instants(loaded, flown.path, flown.instrument, rate, flown.seed)
        existing = existing_captures(output, flight, flown.instrument, flown.light)
        remove_unfinished(output / instant.file for instant in flight)
        record = partial(_record, output, instrument=flown.instrument, light=flown.light)
        with progress_bar(f"Flying {len(flight)} captures", run.progress) as advance:
            frames = []
            for instant in flight:
                done, fraction = instant.number / len(flight), 1 / len(flight)
                if instant.number not in existing:
                    record(instant, progress=_part(advance, done, fraction))
                frames.append(_evaluated(instant, output))
                advance(done + fraction)
        write_animation(animation, frames, rate)
        write_flight(page, loaded.name, frames, rate)
        write_table(table, frames, flight)
    warnings = _warnings(frames)
    warn(warnings)
    written = [*(output / instant.file for instant in flight), animation, page, table]
    if run.json:
        report = {"written": written, "captures": len(flight), "kept": len(existing)}
        print_json(report | {"duration_s": flown.path.duration_s, "warnings": oddities + warnings})
        return
    old = f" ({len(existing)} of them kept)" if existing else ""
    names = ", ".join(file.path.name for file in files)
    say(f"Wrote {len(flight)} captures{old}, {names} to {output}.")
    say(f"Look at it: {page.resolve().as_uri()}")


def _part(
    advance: Callable[[float], None], done: float, fraction: float
) -> Callable[[float], None]:
    return lambda part: advance(done + fraction * part)


def _record(
    folder: Path,
    instant: Instant,
    *,
    instrument: Instrument,
    light: dict[str, Any],
    progress: Callable[[float], None],
) -> None:
    """Simulate and write the capture of an instant; without its time, equal ones are byte-equal."""
    from dataclasses import replace

    from reconstruction import write_capture
    from spisim.simulation import simulate

    capture = simulate(
        instant.scene, instrument, **light, seed=instant.seed, progress=progress
    ).capture
    provenance = replace(capture.provenance, created="")
    write_capture(replace(capture, provenance=provenance), folder / instant.file)


def _evaluated(instant: Instant, folder: Path) -> EvaluatedFrame:
    """Evaluate a capture as read from its file, so that reused and new ones are equal."""
    from reconstruction import evaluate, read_capture, reconstruct
    from reconstruction.diagnostics import result_warnings
    from spisim_app.report.flight import EvaluatedFrame

    capture = read_capture(folder / instant.file)
    with naming(folder / instant.file):
        result = reconstruct(capture)
    warnings = result_warnings(result, capture)
    at = instant.file, instant.time_s, instant.scene.drone_pose
    return EvaluatedFrame(*at, capture, result, evaluate(result, capture), warnings)


def _warnings(frames: list[EvaluatedFrame]) -> list[str]:
    """Return each warning once, with the name of its first capture."""
    first: dict[str, str] = {}
    for frame in frames:
        for warning in frame.warnings:
            first.setdefault(warning, frame.name)
    return [f"{file}: {warning}" for warning, file in first.items()]
