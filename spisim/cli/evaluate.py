"""`spisim evaluate`: reconstruction against truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconstruction.base.errors import InputError, naming

from .console import print_json, progress_bar, say, warn
from .options import (
    CaptureArgument,
    Json,
    Methods,
    MinFree,
    Overwrite,
    StatedWeather,
    number_option,
    with_options,
)
from .tables import print_errors, print_flight, print_recording

if TYPE_CHECKING:
    from reconstruction import Capture
    from reconstruction.base.files import Output
    from spisim.report.flight import EvaluatedFrame

#: Pictures of a film per second, about.
MAX_FILM_HZ = 10.0
EXAMPLE = "spisim evaluate out/demo/capture.h5 out/demo"


@dataclass(frozen=True)
class FlightFiles:
    """Files about a flight."""

    page: Annotated[
        Path | None, typer.Option(metavar="HTML", help="Write a page about a flight.")
    ] = None
    film: Annotated[
        Path | None, typer.Option(metavar="GIF", help="Write an animation of a flight.")
    ] = None
    overwrite: Overwrite = False

    @property
    def outputs(self) -> list[Output]:
        """Those that are asked for."""
        from reconstruction.base.files import Output
        from spisim.report.flight import KIND

        named = ((self.page, (".html", ".htm")), (self.film, (".gif",)))
        return [Output(path, KIND, endings) for path, endings in named if path is not None]


NO_FILES = FlightFiles()


@with_options
def command(
    capture: CaptureArgument,
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="What `reconstruct` wrote.")
    ] = None,
    frame: Annotated[
        int | None, number_option(0, 2**31, "Frame of the capture; of a flight, by default all.")
    ] = None,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    weather: StatedWeather = None,
    min_free: MinFree = None,
    files: FlightFiles = NO_FILES,
    json: Json = False,
) -> None:
    """Compare image, ranges and depth map with the truth of a simulated capture.

    Without the folder of a result, a frame is reconstructed first by the given methods. Of a flight
    with poses, all frames are, in order: maps with and without the memory of earlier frames are
    compared over time. For a recording without truth, report the repeatability of its frames: noise
    against the expected noise, saturation, and spread of ranges.
    """
    from reconstruction import read_capture
    from reconstruction.cli.reconstruct import names
    from reconstruction.depth import check_min_free
    from reconstruction.evaluation import is_flight

    recording = read_capture(capture)
    choice: dict[str, Any] = {"ranging": names(ranging), "weather": weather}
    frames: dict[str, Any] = {"image": names(image), "depth": names(depth)}
    if min_free is not None:
        check_min_free(min_free)
        frames["min_free"] = min_free
    if folder is None and frame is None and is_flight(recording):
        _flight(capture, recording, choice | frames, files, json=json)
    elif files != NO_FILES:
        raise InputError("--page, --film and --overwrite are for all frames of a flight with truth")
    elif folder is None and recording.truth is None:
        _repeatability(capture, recording, frame or 0, choice, json=json)
    else:
        _frame(capture, recording, folder, frame or 0, choice | frames, json=json)


def _repeatability(
    capture: Path, recording: Capture, frame: int, choice: dict[str, Any], *, json: bool
) -> None:
    """Report the noise of a recording without truth."""
    from reconstruction import capture_warnings
    from reconstruction.evaluation import evaluate_recording

    with naming(capture):
        repeatability = evaluate_recording(recording, **choice)
    warnings = capture_warnings(recording, frame)
    warn(warnings)
    if json:
        print_json(repeatability | {"warnings": warnings})
    else:
        print_recording(repeatability)


def _frame(
    capture: Path,
    recording: Capture,
    folder: Path | None,
    frame: int,
    choice: dict[str, Any],
    *,
    json: bool,
) -> None:
    """Compare a frame, or the result in a folder, with the truth."""
    from dataclasses import replace

    from reconstruction import evaluate, read_result, reconstruct
    from reconstruction.diagnostics import result_warnings

    if folder is None:
        with naming(capture):
            result = reconstruct(recording, frame, **choice)
    else:
        if choice["weather"] is not None:
            raise InputError(f"--weather is only for a reconstruction; {folder} holds a result")
        result = read_result(folder / "result.h5")
        if "min_free" in choice:
            result = replace(result, min_free=choice["min_free"])
    with naming(capture if folder is None else f"{folder / 'result.h5'} for {capture}"):
        metrics = evaluate(result, recording)
    warnings = result_warnings(result, recording)
    warn(warnings)
    if json:
        print_json(metrics | {"warnings": warnings})
    else:
        print_errors(metrics)


def _flight(
    capture: Path, recording: Capture, choice: dict[str, Any], files: FlightFiles, *, json: bool
) -> None:
    """Compare the frames of a flight, and write its page and film."""
    from reconstruction.base.files import require_outputs
    from reconstruction.evaluation import evaluate_flight
    from spisim.report.flight import EvaluatedFrame, write_animation
    from spisim.report.flight_page import write_flight

    outputs = files.outputs
    require_outputs(outputs, [capture], overwrite=files.overwrite)
    frames: list[EvaluatedFrame] = []

    def judged(*given: Any) -> None:
        if outputs:
            frames.append(EvaluatedFrame.of_recording(recording, *given))

    with naming(capture), progress_bar("Evaluating", None) as advance:
        comparison = evaluate_flight(recording, **choice, judged=judged, progress=advance)
    if files.page is not None:
        write_flight(files.page, capture.stem, frames, _rate_hz(frames), comparison)
    if files.film is not None:
        step = max(1, round(_rate_hz(frames) / MAX_FILM_HZ))
        write_animation(files.film, frames[::step], _rate_hz(frames) / step)
    warn(comparison["notes"])
    if json:
        print_json(comparison | {"written": [each.path for each in outputs]})
        return
    print_flight(comparison)
    for each in outputs:
        say(f"Wrote {each.path}.")


def _rate_hz(frames: list[EvaluatedFrame]) -> float:
    """Return how many of these frames there are a second, 1 if unknown."""
    seconds = frames[-1].time_s - frames[0].time_s
    return (len(frames) - 1) / seconds if seconds > 0 else 1.0
