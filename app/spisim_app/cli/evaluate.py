"""`spisim evaluate`: reconstruction against truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconstruction.base.errors import InputError, naming

from . import options as opt
from .console import print_json, progress_bar, say, warn
from .tables import print_errors, print_flight, print_recording

if TYPE_CHECKING:
    from collections.abc import Callable

    from reconstruction import Capture
    from reconstruction.base.files import Output
    from spisim_app.report.flight import EvaluatedFrame

    Evaluation = tuple[dict[str, Any], list[str], Callable[[Any], None]]
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
    overwrite: opt.Overwrite = False

    @property
    def outputs(self) -> list[Output]:
        """Those that are asked for."""
        from reconstruction.base.files import Output
        from spisim_app.report.flight import KIND

        named = ((self.page, (".html", ".htm")), (self.film, (".gif",)))
        return [Output(path, KIND, endings) for path, endings in named if path is not None]


NO_FILES = FlightFiles()


@opt.with_options
def command(
    capture: opt.CaptureArgument,
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="What `reconstruct` wrote.")
    ] = None,
    frame: Annotated[
        int | None,
        opt.number_option(0, 2**31, "Frame of the capture; of a flight, by default all."),
    ] = None,
    image: opt.Methods = None,
    ranging: opt.Methods = None,
    depth: opt.Methods = None,
    weather: opt.StatedWeather = None,
    min_free: opt.MinFree = None,
    files: FlightFiles = NO_FILES,
    json: opt.Json = False,
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
        figures, warnings, show = _flight(capture, recording, choice | frames, files)
    elif files != NO_FILES:
        raise InputError("--page, --film and --overwrite are for all frames of a flight with truth")
    elif folder is None and recording.truth is None:
        figures, warnings, show = _repeatability(capture, recording, frame or 0, choice)
    else:
        every = choice | frames
        figures, warnings, show = _frame(capture, recording, folder, frame or 0, every)
    warn(warnings)
    if json:
        print_json(figures | {"warnings": warnings})
        return
    show(figures)
    for each in files.outputs:
        say(f"Wrote {each.path}.")


def _repeatability(
    capture: Path, recording: Capture, frame: int, choice: dict[str, Any]
) -> Evaluation:
    """Measure the noise of a recording without truth."""
    from reconstruction import capture_warnings
    from reconstruction.evaluation import evaluate_recording

    with naming(capture):
        repeatability = evaluate_recording(recording, **choice)
    return repeatability, capture_warnings(recording, frame), print_recording


def _frame(
    capture: Path, recording: Capture, folder: Path | None, frame: int, choice: dict[str, Any]
) -> Evaluation:
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
    return metrics, result_warnings(result, recording), print_errors


def _flight(
    capture: Path, recording: Capture, choice: dict[str, Any], files: FlightFiles
) -> Evaluation:
    """Compare the frames of a flight, and write its page and film."""
    from reconstruction.base.folders import output_files
    from reconstruction.evaluation import evaluate_flight
    from spisim_app.report.flight import EvaluatedFrame, write_animation
    from spisim_app.report.flight_page import write_flight

    outputs = files.outputs
    with output_files(outputs, [capture], overwrite=files.overwrite):
        frames: list[EvaluatedFrame] = []

        def judged(*given: Any) -> None:
            if outputs:
                frames.append(EvaluatedFrame.of_recording(recording, *given))

        with naming(capture), progress_bar("Evaluating", None) as advance:
            comparison = evaluate_flight(recording, **choice, judged=judged, progress=advance)
        if outputs:
            seconds = frames[-1].time_s - frames[0].time_s
            rate_hz = (len(frames) - 1) / seconds if seconds > 0 else 1.0
        if files.page is not None:
            write_flight(files.page, capture.stem, frames, rate_hz, comparison)
        if files.film is not None:
            step = max(1, round(rate_hz / MAX_FILM_HZ))
            write_animation(files.film, frames[::step], rate_hz / step)
        written = {"written": [each.path for each in outputs]}
        return comparison | written, comparison["notes"], print_flight
