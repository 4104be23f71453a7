"""`spisim fly`: a flight through a scene, capture by capture."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from reconstruction.base.errors import naming

from . import options as opt
from .console import print_json, progress_bar, say, warn
from .inputs import instrument_with, scene_with
from .outputs import files_read, resumed
from .weather_options import OWN_WEATHER_OF_DROPS, WeatherOfDrops

if TYPE_CHECKING:
    from collections.abc import Callable

    from spisim.base.config import LightSource
    from spisim.dataset.flight import Instant
    from spisim.instrument import Instrument
    from spisim.report.flight import EvaluatedFrame

EXAMPLE = "spisim fly warehouse --path warehouse-flight -o out/flight --spp 64"


@opt.with_options
def command(
    scene: opt.SceneArgument,
    path: Annotated[
        str, typer.Option("--path", metavar="FILE", help="Poses or way-points: CSV or TUM.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="A folder.")],
    instrument: opt.InstrumentOption = "paper",
    frame: Annotated[
        str, typer.Option(help="What quaternions of the path turn: body or optical.")
    ] = "body",
    rate: Annotated[
        float, opt.real_option("Captures per second.", minimum=0.01, maximum=1e4, metavar="HZ")
    ] = 2.0,
    speed: Annotated[
        float, opt.real_option("Fly the path X times as fast.", minimum=0.01, maximum=100)
    ] = 1.0,
    weather: WeatherOfDrops = OWN_WEATHER_OF_DROPS,
    stated: opt.StatedWeather = None,
    seed: opt.Seed = 0,
    light: Annotated[
        Literal["traced", "surrogate"], typer.Option(help="surrogate: fast, for training data.")
    ] = "traced",
    spp: opt.Spp = 256,
    overwrite: opt.Overwrite = False,
    json: opt.Json = False,
    progress: opt.Bar = None,
) -> None:
    """Fly a path: one capture per instant with the drone's motion, then its image and depth.

    Writes capture-0000.h5 and so on, a page, an animation and a table. Existing captures of the
    same flight are reused, so an interrupted flight continues.
    """
    from reconstruction.base.files import remove_unfinished
    from reconstruction.base.folders import output_folder
    from spisim.dataset.flight import existing_captures, instants
    from spisim.report.flight import flight_outputs, write_animation, write_table
    from spisim.report.flight_page import write_flight
    from spisim.scene import check_clear_path, load_trajectory

    files = flight_outputs(output)
    animation, page, table = (file.path for file in files)
    read = files_read(scene, instrument, path)
    with output_folder(output, files, read, overwrite=overwrite), resumed():
        trajectory = load_trajectory(path, frame).faster(speed)
        carried = instrument_with(instrument, stated=stated or trajectory.weather)
        loaded, oddities = scene_with(scene, carried.wavelength_nm, weather)
        check_clear_path(loaded, trajectory)
        flight = instants(loaded, trajectory, carried, rate, seed)
        existing = existing_captures(output, flight, carried, light, spp)
        remove_unfinished(output / instant.file for instant in flight)
        record = partial(_record, output, instrument=carried, light=light, spp=spp)
        with progress_bar(f"Flying {len(flight)} captures", progress) as advance:
            frames = []
            for instant in flight:
                done, fraction = instant.number / len(flight), 1 / len(flight)
                if instant.number not in existing:
                    record(instant, progress=_part(advance, done, fraction))
                frames.append(_evaluated(instant, output))
                advance(done + fraction)
        write_animation(animation, frames, rate)
        write_flight(page, loaded.name, frames, rate)
        write_table(table, frames)
    warnings = _warnings(frames)
    warn(warnings)
    written = [*(output / instant.file for instant in flight), animation, page, table]
    if json:
        report = {"written": written, "captures": len(flight), "kept": len(existing)}
        print_json(report | {"duration_s": trajectory.duration_s, "warnings": oddities + warnings})
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
    light: LightSource,
    spp: int,
    progress: Callable[[float], None],
) -> None:
    """Simulate and write the capture of an instant; without its time, equal ones are byte-equal."""
    from dataclasses import replace

    from reconstruction import write_capture
    from spisim.simulation import simulate

    capture = simulate(
        instant.scene, instrument, light=light, spp=spp, seed=instant.seed, progress=progress
    ).capture
    provenance = replace(capture.provenance, created="")
    write_capture(replace(capture, provenance=provenance), folder / instant.file)


def _evaluated(instant: Instant, folder: Path) -> EvaluatedFrame:
    """Evaluate a capture as read from its file, so that reused and new ones are equal."""
    from reconstruction import evaluate, read_capture, reconstruct
    from reconstruction.diagnostics import result_warnings
    from spisim.report.flight import EvaluatedFrame

    capture = read_capture(folder / instant.file)
    with naming(folder / instant.file):
        result = reconstruct(capture)
    warnings = result_warnings(result, capture)
    return EvaluatedFrame(instant, capture, result, evaluate(result, capture), warnings)


def _warnings(frames: list[EvaluatedFrame]) -> list[str]:
    """Return each warning once, with the name of its first capture."""
    first: dict[str, str] = {}
    for frame in frames:
        for warning in frame.warnings:
            first.setdefault(warning, frame.instant.file)
    return [f"{file}: {warning}" for warning, file in first.items()]
