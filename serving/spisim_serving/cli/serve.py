"""`spisim serve`: a simulated drone that replaces a rig."""

from __future__ import annotations

from contextlib import closing, suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from reconstruction.base.errors import InputError
from spisim_app.cli import options as opt
from spisim_app.cli.console import progress_bar, say
from spisim_app.cli.inputs import instrument_with, scene_with
from spisim_app.cli.outputs import files_read
from spisim_app.cli.weather_options import OWN_WEATHER_OF_DROPS, WeatherOfDrops
from spisim_serving.cli.flights import AS_COMMANDED, FlightOptions
from spisim_serving.cli.line import SOCKET, LinkOptions
from spisim_serving.cli.telling import report, tell

if TYPE_CHECKING:
    from reconstruction.base.files import Output
    from spisim.simulation.flight import Camera
    from spisim_serving.server import Server

EXAMPLE = "spisim serve warehouse --light surrogate --visibility 50"

#: Cached key poses; each takes a third of a megabyte at 64 x 64 pixels.
CACHED = 512


@dataclass(frozen=True)
class KeyLightOptions:
    """Light at key poses, between which it is interpolated."""

    light: Annotated[
        Literal["traced", "surrogate"], typer.Option(help="surrogate: a fast stand-in.")
    ] = "traced"
    spp: opt.Spp = 64
    spacing: Annotated[
        float,
        opt.real_option(
            "Distance between key poses, where light is solved.",
            minimum=0.001,
            maximum=0.1,
            metavar="M",
        ),
    ] = 0.05


@dataclass(frozen=True)
class RecordOptions:
    """A capture of all that is sent, with its truth."""

    record: Annotated[
        Path | None,
        typer.Option(metavar="CAPTURE", help="Keep frames and truth, and beside them the path."),
    ] = None
    truths: Annotated[int, opt.number_option(1, 10**6, "Keep the truth of every Nth frame.")] = 12

    @property
    def outputs(self) -> list[Output]:
        """The first files of the record, if there is one."""
        from spisim_serving.record import record_outputs

        return [] if self.record is None else record_outputs(self.record)


TRACED = KeyLightOptions()
NO_RECORD = RecordOptions()


@opt.with_options
def command(
    scene: opt.SceneArgument,
    flown: FlightOptions = AS_COMMANDED,
    instrument: opt.InstrumentOption = "paper",
    link: LinkOptions = SOCKET,
    light: KeyLightOptions = TRACED,
    duration: Annotated[
        float | None,
        opt.real_option("End after this time.", minimum=1e-6, maximum=1e6, metavar="SECONDS"),
    ] = None,
    poses: Annotated[
        bool, typer.Option("--poses", help="Send the true pose of every frame with it.")
    ] = False,
    recorded: RecordOptions = NO_RECORD,
    weather: WeatherOfDrops = OWN_WEATHER_OF_DROPS,
    stated: opt.StatedWeather = None,
    seed: opt.Seed = 0,
    run: opt.RunOptions = opt.RUN,
) -> None:
    """Send simulated frames like a real camera, and fly as commanded.

    Light is solved at key poses, and interpolated between them; docs/reference/stream-format.md has
    the messages.
    """
    from reconstruction.base.folders import output_files
    from reconstruction.capture import Poses
    from spisim.simulation.flight import Camera, FlightRecorder, Motion, provenance, solver
    from spisim_serving.record import FlightRecord
    from spisim_serving.server import Server

    if run.json and link.to == "-":
        raise InputError("--json and --to - exclude each other: both write to stdout")
    read = [*files_read(scene, instrument, *([flown.path] if flown.path else [])), *link.read]
    outputs = [*recorded.outputs, *link.outputs]
    with (
        output_files(outputs, read, overwrite=run.overwrite),
        closing(link.line(steered=flown.path is None)) as line,
    ):
        trajectory = flown.trajectory()
        of_path = None if trajectory is None else trajectory.weather
        carried = instrument_with(instrument, stated=stated or of_path)
        loaded, oddities = scene_with(scene, carried.wavelength_nm, weather)
        flight = flown.flight(loaded, trajectory, light.spacing, at_once=link.lockstep)
        solve = solver(carried, light.light, spp=light.spp, seed=seed)
        cached = max(CACHED, flight.ahead)
        camera = Camera(flight.scene, carried, flight.keys, solve, seed=seed, cached=cached)
        _solve_ahead(camera, flight.ahead, run.progress)
        settings: dict[str, Any] = {"spp": light.spp} if light.light == "traced" else {}
        settings |= {"spacing_m": light.spacing, "lockstep": link.lockstep}
        source = partial(provenance, flight.scene, carried, light.light, seed=seed)
        setup = camera.setup(Motion.at_rest(flight.scene, carried.frame_time_s))
        recording = None
        if (path := recorded.record) is not None:
            about = (flight.scene, setup, source(settings=settings))

            def recorder(part: Path) -> FlightRecorder:
                return FlightRecorder(part, *about, truths=recorded.truths)

            recording = FlightRecord(
                path, recorder, len(setup.plans), read, overwrite=run.overwrite
            )
        server = Server(
            camera,
            flight.pilot,
            line,
            replace(setup, poses=Poses.none(0)) if poses else setup,
            source(settings=settings),
            maximum=None if duration is None else max(1, round(duration / carried.frame_time_s)),
            record=(lambda shot: None) if recording is None else recording.add,
            say=say,
            states=tell,
        )
        say(f"Sending {1 / carried.frame_time_s:.4g} frames a second to {link.to}.")
        written: list[Path] = []
        try:
            _run(server, link)
        finally:
            if recording is not None:
                tally = {"tally": asdict(server.tally)}
                written = recording.finish(source(settings=settings | tally))
    report(server, written, oddities, json=run.json)


def _run(server: Server, link: LinkOptions) -> None:
    """Run until the flight ends or Ctrl-C is pressed, then tell the other side."""
    from spisim_live.links import is_link

    with suppress(KeyboardInterrupt):
        if link.lockstep:
            server.run_in_step()
        elif is_link(link.to):
            server.run_at_rate()
        else:
            server.run_at_once()
    with suppress(OSError):
        server.end()


def _solve_ahead(camera: Camera, ahead: int, progress: bool | None) -> None:
    """Solve the light at the first keys, so that no frame waits for it."""
    with progress_bar(f"Light at {ahead} key poses", progress) as advance:
        for number in range(ahead if ahead > 1 else 0):
            camera.lattice.at((number,))
            advance((number + 1) / ahead)
