"""`spisim serve`: a simulated drone in place of a rig."""

from __future__ import annotations

from contextlib import closing, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from .. import options as opt
from ..console import progress_bar, say, warn
from ..inputs import instrument_with, scene_with
from ..outputs import files_read
from ..weather_options import OWN_WEATHER_OF_DROPS, WeatherOfDrops, with_weather
from .flights import along, as_commanded, at_rest, check_options
from .line import line_to
from .telling import report, tell

if TYPE_CHECKING:
    from spisim.serving import Camera, Server

EXAMPLE = "spisim serve warehouse --light surrogate --visibility 50"

#: Key poses that are kept; each takes a third of a megabyte at 64 x 64 pixels.
RETAINED = 512


@with_weather
def command(
    scene: opt.SceneArgument,
    path: Annotated[
        str | None,
        typer.Option("--path", metavar="FILE", help="Fly it; else as commands say. CSV or TUM."),
    ] = None,
    pose: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z[,YAW[,PITCH]]", help="Begin here, in m and degrees."),
    ] = None,
    instrument: opt.InstrumentOption = "paper",
    to: Annotated[
        str,
        typer.Option(
            metavar="OUTLET",
            help="tcp-listen://HOST:PORT, tcp://, udp://, serial://, - (a pipe) or FILE.stream.",
        ),
    ] = "tcp-listen://127.0.0.1:5800",
    commands: Annotated[
        str | None,
        typer.Option(metavar="SOURCE", help="Where commands come from, if not from there too."),
    ] = None,
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="A frame for each command, however long it takes.")
    ] = False,
    light: Annotated[
        Literal["traced", "surrogate"],
        typer.Option(help="surrogate: a fast stand-in."),
    ] = "traced",
    spp: opt.Spp = 64,
    spacing: Annotated[
        float,
        opt.real_option(
            "Between key poses, where light is solved.", minimum=0.001, maximum=0.1, metavar="M"
        ),
    ] = 0.05,
    duration: Annotated[
        float | None,
        opt.real_option("End after so long.", minimum=1e-6, maximum=1e6, metavar="SECONDS"),
    ] = None,
    gust: Annotated[
        list[str] | None,
        typer.Option(
            metavar="START,SECONDS,X,Y,Z",
            help="Blows the drone off by so many m forward, left and up; it does not notice.",
        ),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(metavar="CAPTURE", help="Keep frames and truth, and beside them the path."),
    ] = None,
    truths: Annotated[int, opt.number_option(1, 10**6, "Keep the truth of every Nth frame.")] = 12,
    frame: Annotated[
        str, typer.Option(help="What quaternions of the path turn: body or optical.")
    ] = "body",
    speed: Annotated[
        float, opt.real_option("Fly the path X times as fast.", minimum=0.01, maximum=100)
    ] = 1.0,
    weather: WeatherOfDrops = OWN_WEATHER_OF_DROPS,
    stated: opt.StatedWeather = None,
    seed: opt.Seed = 0,
    overwrite: opt.Overwrite = False,
    json: opt.Json = False,
    progress: opt.Bar = None,
) -> None:
    """Send simulated frames as a rig does, and fly as the commands say that come back.

    Light is solved at key poses, and interpolated between them; docs/reference/stream-format.md has
    the messages.
    """
    from spisim.scene import load_trajectory
    from spisim.serving import Camera, FlightRecord, Server, provenance, solver
    from spisim.serving.record import MAX_FRAMES

    path_options = {"--frame": frame != "body", "--speed": speed != 1}
    check_options(path, pose, gust, path_options, to, json=json)
    read = list(files_read(scene, instrument, *([path] if path else [])))
    _check_record(record, read, overwrite=overwrite)
    line = line_to(to, commands, read, steered=path is None, lockstep=lockstep, overwrite=overwrite)
    with closing(line):
        trajectory = None if path is None else load_trajectory(path, frame).faster(speed)
        of_path = None if trajectory is None else trajectory.weather
        carried = instrument_with(instrument, stated=stated or of_path)
        position, oddities = scene_with(scene, carried.wavelength_nm, weather)
        if trajectory is None:
            flight = as_commanded(position, pose, gust or [], spacing)
        else:
            flight = along(position, trajectory, spacing, at_once=lockstep)
        solve = solver(carried, light, spp=spp, seed=seed)
        retained = max(RETAINED, flight.ahead)
        camera = Camera(flight.scene, carried, flight.keys, solve, seed=seed, retained=retained)
        _solve_ahead(camera, flight.ahead, progress)
        recording = None if record is None else FlightRecord(record, flight.scene, carried, truths)
        reported: dict[str, Any] = {"spp": spp} if light == "traced" else {}
        reported |= {"spacing_m": spacing, "lockstep": lockstep}
        source = partial(provenance, flight.scene, carried, light, seed=seed)
        setup = camera.setup(at_rest(flight.scene, carried.frame_time_s))
        server = Server(
            camera,
            flight.pilot,
            line,
            setup,
            source(settings=reported),
            maximum=None if duration is None else max(1, round(duration / carried.frame_time_s)),
            retained=(lambda shot: None) if recording is None else recording.add,
            say=say,
            states=tell,
        )
        say(f"Sending {1 / carried.frame_time_s:.4g} frames a second to {to}.")
        written: list[Path] = []
        try:
            _run(server, to, lockstep=lockstep)
        finally:
            if recording is not None:
                tally = {"tally": asdict(server.tally)}
                written = recording.write(setup, source(settings=reported | tally))
    if recording is not None and recording.full:
        oddities.append(f"the record is full: it has the first {MAX_FRAMES} frames")
        warn(oddities[-1:])
    report(server, written, oddities, json=json)


def _check_record(record: Path | None, read: list[Path], *, overwrite: bool) -> None:
    """Whether the record can be written."""
    from reconstruction.base.files import require_outputs
    from spisim.serving.record import record_outputs

    if record is not None:
        require_outputs(record_outputs(record), read, overwrite=overwrite)


def _run(server: Server, to: str, *, lockstep: bool) -> None:
    """Until the flight is over, or Ctrl-C; the other side is told that it is."""
    from reconstruction.live.links import is_link

    with suppress(KeyboardInterrupt):
        if lockstep:
            server.run_in_step()
        elif is_link(to):
            server.run_at_rate()
        else:
            server.run_at_once()
    with suppress(OSError):
        server.end()


def _solve_ahead(camera: Camera, ahead: int, progress: bool | None) -> None:
    """Light at the first keys, of which no frame is late then."""
    with progress_bar(f"Light at {ahead} key poses", progress) as advance:
        for number in range(ahead if ahead > 1 else 0):
            camera.lattice.at((number,))
            advance((number + 1) / ahead)
