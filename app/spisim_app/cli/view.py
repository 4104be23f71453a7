"""`spisim view`: captures, flights, data sets and streams in Rerun."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reconstruction.base.errors import InputError

from .console import print_json, say, warn
from .inputs import captures_in
from .options import Json, Methods, Overwrite, number_option

if TYPE_CHECKING:
    from spisim_app.report.viewer import Recording, View

EXAMPLE = "spisim view foggy.h5"
MANIFEST = "manifest.sqlite"


def command(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="A capture, the folder of a flight, a data set, or a stream: tcp://HOST:PORT, "
            "tcp-listen://:PORT, udp://:PORT, serial://…, FILE.stream.",
            show_default=False,
        ),
    ],
    save: Annotated[
        Path | None,
        typer.Option(metavar="RRD", help="Write a recording instead, for `rerun FILE.rrd`."),
    ] = None,
    frames: Annotated[int | None, number_option(1, 10**9, "End after this many frames.")] = None,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Display scene, drone, spots, clouds, images and readings over time in the viewer Rerun.

    Frames of a stream appear as they are reconstructed, until it ends or Ctrl-C.
    """
    from reconstruction.cli.reconstruct import names
    from spisim_live.links import is_link

    methods = {"image": names(image), "ranging": names(ranging), "depth": names(depth)}
    streamed = is_link(source) or Path(source).suffix == ".stream"
    _check(source, save)
    with _recording(save, Path(source), overwrite) as recording:
        if streamed:
            _follow(source, recording, frames, methods)
        else:
            _show(_views(Path(source), methods), recording, frames)
    if json:
        print_json({"written": [] if save is None else [save], "frames": recording.frames})
    elif save is not None:
        say(f"Wrote {save}. Look at it: rerun {save}")


def _check(source: str, save: Path | None) -> None:
    from spisim_app.report.viewer.recording import check_viewer, library

    try:
        library()
    except InputError as error:
        raise InputError(f"{error}. {_report_of(Path(source))}") from None
    if save is None:
        check_viewer()


def _report_of(source: Path) -> str:
    """Tell where there is a page to open without the viewer, or how to make one."""
    pages = (source.with_suffix(".html"), source / "report.html", source / "flight.html")
    for page in pages:
        if page.is_file():
            return f"Without it there is {page.resolve().as_uri()}"
    if (source / MANIFEST).is_file():
        return f"Without it: spisim dataset sheet {source} -o sheet.html"
    return f"Without it: spisim reconstruct {source} -o result, which writes result/report.html"


@contextmanager
def _recording(save: Path | None, source: Path, overwrite: bool) -> Iterator[Recording]:
    """Return a recording that is displayed, or a file that appears when complete."""
    from reconstruction.base.folders import output_files
    from spisim_app.report.viewer import Recording
    from spisim_app.report.viewer.recording import recording_output

    if save is None:
        recording = Recording()
        try:
            yield recording
        finally:
            recording.close()
        return
    with output_files([recording_output(save)], [source], overwrite=overwrite):
        stage = save.with_name(f".{save.stem}.{secrets.token_hex(4)}.tmp{save.suffix}")
        try:
            recording = Recording(stage)
            try:
                yield recording
            finally:
                recording.close()
            stage.replace(save)
        finally:
            stage.unlink(missing_ok=True)


def _views(source: Path, methods: dict[str, Any]) -> Iterator[View]:
    from spisim.dataset import open as open_data_set
    from spisim_app.report.viewer import views_of_captures, views_of_samples

    if (source / MANIFEST).is_file():
        return views_of_samples(open_data_set(source), methods)
    return views_of_captures(captures_in([source]), methods)


def _show(views: Iterator[View], recording: Recording, frames: int | None) -> None:
    from itertools import islice
    from warnings import catch_warnings, simplefilter

    with catch_warnings(record=True) as odd:
        simplefilter("always", UserWarning)
        for view in islice(views, frames):
            recording.add(view)
    warn(dict.fromkeys(str(warning.message) for warning in odd))


def _follow(source: str, recording: Recording, frames: int | None, choice: dict[str, Any]) -> None:
    import threading

    from spisim_app.report.viewer import StreamViewer
    from spisim_live import Loop, Reception, State
    from spisim_live.links import source_at

    viewer = StreamViewer(recording, source)
    reception = Reception(source_at(source), recorders=[viewer.frame])
    trouble = reception.trouble

    def tell(state: State) -> None:
        nonlocal trouble
        if state.trouble and state.trouble != trouble:
            say(state.trouble)
        trouble = state.trouble

    loop = Loop(reception, results=[viewer.result], states=[tell], **choice)
    say(f"Waiting for frames of {source}; Ctrl-C ends.")
    receiving = threading.Thread(target=reception.run, name="reception", daemon=True)
    receiving.start()
    try:
        loop.run(frames)
    except KeyboardInterrupt:
        say("")
    finally:
        reception.stop()
        receiving.join(5.0)
    if not reception.counts.reconstructed:
        raise InputError(
            f"{source}: no frame was reconstructed: {reception.trouble or 'none came'}"
        )
