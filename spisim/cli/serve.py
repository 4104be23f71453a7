"""`spisim serve`: a simulated drone in place of a rig."""

from __future__ import annotations

from contextlib import closing, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from reconstruction.errors import InputError

from . import options as opt
from .console import print_json, progress_bar, say, warn
from .inputs import instrument_with, scene_with
from .outputs import files_read

if TYPE_CHECKING:
    from spisim.scene import Scene
    from spisim.serving import Camera, Gust, Keys, Line, Motion, Pilot, Server

EXAMPLE = "spisim serve warehouse --light surrogate --visibility 50"

#: Key poses that are kept; each takes a third of a megabyte at 64 x 64 pixels.
KEPT = 512
#: Key poses of a path, all of which are kept where it is flown in time.
MOST_AHEAD = 2000


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
            "Between key poses, where light is solved.", least=0.001, most=0.1, metavar="M"
        ),
    ] = 0.05,
    duration: Annotated[
        float | None,
        opt.real_option("End after so long.", least=1e-6, most=1e6, metavar="SECONDS"),
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
        float, opt.real_option("Fly the path X times as fast.", least=0.01, most=100)
    ] = 1.0,
    visibility: opt.Visibility = None,
    fog: opt.Fog = None,
    rain: opt.Rain = None,
    drops: opt.Drops = False,
    clear: opt.Clear = False,
    seed: opt.Seed = 0,
    overwrite: opt.Overwrite = False,
    json: opt.Json = False,
    progress: opt.Bar = None,
) -> None:
    """Send simulated frames as a rig does, and fly as the commands say that come back.

    Light is solved at key poses, and interpolated between them; docs/live.md has the messages.
    """
    from spisim.scene import check_clear_path, load_trajectory
    from spisim.serving import (
        Camera,
        Drone,
        FlightRecord,
        Follower,
        PathKeys,
        PoseKeys,
        Server,
        provenance,
        solver,
    )
    from spisim.serving.record import MOST_FRAMES

    _check_options(path, pose, gust, to, json=json)
    read = list(files_read(scene, instrument, *([path] if path else [])))
    _check_record(record, read, overwrite=overwrite)
    line = _line(to, commands, read, steered=path is None, lockstep=lockstep, overwrite=overwrite)
    with closing(line):
        carried = instrument_with(instrument)
        place, oddities = scene_with(
            scene, carried.wavelength_nm, visibility, clear, fog, rain, drops
        )
        keys: Keys
        pilot: Pilot
        ahead = 1
        if path is not None:
            trajectory = load_trajectory(path, frame).faster(speed)
            check_clear_path(place, trajectory)
            keys, pilot = PathKeys(place, trajectory, spacing), Follower(trajectory)
            ahead = 1 if lockstep else _checked(keys.count)
        else:
            place = place if pose is None else _placed(place, pose)
            keys, pilot = PoseKeys(place, spacing), Drone(place, tuple(map(_gust, gust or ())))
        solve = solver(carried, light, spp=spp, seed=seed)
        camera = Camera(place, carried, keys, solve, seed=seed, kept=max(KEPT, ahead))
        flight = None if record is None else FlightRecord(record, place, carried, truths)
        told: dict[str, Any] = {"spp": spp} if light == "traced" else {}
        told |= {"spacing_m": spacing, "lockstep": lockstep}
        _solve_ahead(camera, ahead, progress)
        setup = camera.setup(_at_rest(place, carried.frame_time_s))
        server = Server(
            camera,
            pilot,
            line,
            setup,
            provenance(place, carried, light, seed=seed, settings=told),
            most=None if duration is None else max(1, round(duration / carried.frame_time_s)),
            kept=(lambda shot: None) if flight is None else flight.add,
            say=say,
            states=_tell,
        )
        say(f"Sending {1 / carried.frame_time_s:.4g} frames a second to {to}.")
        written: list[Path] = []
        try:
            with suppress(KeyboardInterrupt):
                _run(server, to, lockstep=lockstep)
            with suppress(OSError):
                server.end()
        finally:
            if flight is not None:
                told |= {"tally": asdict(server.tally)}
                source = provenance(place, carried, light, seed=seed, settings=told)
                written = flight.write(setup, source)
    if flight is not None and flight.full:
        oddities.append(f"the record is full: it has the first {MOST_FRAMES} frames")
        warn(oddities[-1:])
    _report(server, written, oddities, json=json)


def _check_options(
    path: str | None, pose: str | None, gust: list[str] | None, to: str, *, json: bool
) -> None:
    """Those that exclude each other."""
    if json and to == "-":
        raise InputError("--json and --to - exclude each other: both write to stdout")
    for option, value in (("--pose", pose), ("--gust", gust)):
        if path is not None and value:
            raise InputError(f"--path and {option} exclude each other")


def _check_record(record: Path | None, read: list[Path], *, overwrite: bool) -> None:
    """Whether the record can be written."""
    from reconstruction.files import require_outputs
    from spisim.serving.record import record_outputs

    if record is not None:
        require_outputs(record_outputs(record), read, overwrite=overwrite)


def _line(
    to: str,
    commands: str | None,
    read: list[Path],
    *,
    steered: bool,
    lockstep: bool,
    overwrite: bool,
) -> Line:
    """The line, whose places are there to be used; commands come back where they can."""
    import time

    from reconstruction.files import Output, require_outputs
    from reconstruction.live.framing import MAGIC
    from reconstruction.live.links import NewFile, Source, is_link, outlet_to, source_at
    from spisim.serving import Line

    outlet = outlet_to(to)
    if isinstance(outlet, NewFile):
        file = Output(Path(to), "stream", (".stream",), MAGIC.decode())
        require_outputs([file], read, overwrite=overwrite)
    source: Source | None = None
    if commands is not None:
        source = source_at(commands)
    elif isinstance(outlet, Source):
        source = outlet
    elif to == "-" and (steered or lockstep):
        source = source_at("-")
    if source is None and lockstep:
        raise InputError(f"--lockstep needs commands, and {to} brings none: tell --commands")
    lasting = to != "-" and is_link(to)
    return Line(outlet, source, lasting=lasting, say=say, wait=time.sleep)


def _checked(ahead: int) -> int:
    """Key poses of a path, all of which are kept."""
    if ahead > MOST_AHEAD:
        raise InputError(
            f"the path has {ahead} key poses, at most {MOST_AHEAD} where it is flown in time: "
            "tell a larger --spacing, a shorter path, or --lockstep"
        )
    return ahead


def _solve_ahead(camera: Camera, ahead: int, progress: bool | None) -> None:
    """Light at the first keys, of which no frame is late then."""
    with progress_bar(f"Light at {ahead} key poses", progress) as advance:
        for number in range(ahead if ahead > 1 else 0):
            camera.lattice.at((number,))
            advance((number + 1) / ahead)


def _at_rest(scene: Scene, duration_s: float) -> Motion:
    """Where a scene has its drone."""
    from scipy.spatial.transform import Rotation

    from spisim.serving import Motion

    place_m, turn = scene.drone_pose[:3, 3], Rotation.from_matrix(scene.drone_pose[:3, :3])
    return Motion(0.0, duration_s, place_m, place_m, turn, turn)


def _placed(scene: Scene, text: str) -> Scene:
    """A scene with the drone where an option says."""
    from math import cos, radians, sin

    from spisim.scene import at_moment
    from spisim.scene.description import Moment

    numbers = _numbers(text, "--pose", (3, 4, 5), "X,Y,Z[,YAW[,PITCH]] in m and degrees")
    position = x, y, z = numbers[0], numbers[1], numbers[2]
    ahead = tuple(scene.drone_pose[:3, 2].tolist())
    up = tuple((-scene.drone_pose[:3, 1]).tolist())
    if len(numbers) > 3:
        yaw, pitch = (radians(angle) for angle in (*numbers[3:], 0.0)[:2])
        ahead = cos(yaw) * cos(pitch), sin(yaw) * cos(pitch), sin(pitch)
        up = -cos(yaw) * sin(pitch), -sin(yaw) * sin(pitch), cos(pitch)
    moment = Moment(
        time_s=0.0,
        position_m=position,
        look_at_m=(x + ahead[0], y + ahead[1], z + ahead[2]),
        up=up,
    )
    return at_moment(scene, moment)


def _gust(text: str) -> Gust:
    from spisim.serving import Gust

    start_s, duration_s, x, y, z = _numbers(text, "--gust", (5,), "START,SECONDS,X,Y,Z in s and m")
    if not duration_s > 0:
        raise InputError(f"--gust {text}: it should last longer than 0 s")
    return Gust(start_s, duration_s, (x, y, z))


def _numbers(text: str, option: str, counts: tuple[int, ...], what: str) -> list[float]:
    from math import isfinite

    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(isfinite, numbers)):
        raise InputError(f"{option} {text}: should be {what}")
    return numbers


def _run(server: Server, to: str, *, lockstep: bool) -> None:
    from reconstruction.live.links import is_link

    if lockstep:
        server.run_in_step()
    elif is_link(to):
        server.run_at_rate()
    else:
        server.run_at_once()


def _tell(server: Server) -> None:
    """Once a second."""
    say("; ".join(_words(server)))


def _words(server: Server) -> list[str]:
    tally = server.tally
    words = [f"{tally.frames} frames, {server.time_s:.1f} s"]
    words += [f"{server.camera.lattice.solved} key poses"]
    if tally.late:
        words += [f"late {tally.late}, {tally.behind_s:.1f} s behind in all"]
    counts = {name: value for name, value in asdict(tally).items() if value}
    for name in ("repeated", "refused", "corrupted", "stops", "discarded_bytes"):
        if name in counts:
            words += [f"{name} {counts[name]}"]
    return words


def _report(server: Server, written: list[Path], oddities: list[str], *, json: bool) -> None:
    if json:
        tally = asdict(server.tally) | {"key_poses": server.camera.lattice.solved}
        print_json({"written": written, "time_s": server.time_s, **tally, "warnings": oddities})
        return
    say(f"Sent {'; '.join(_words(server))}.")
    if written:
        say(f"Wrote {' and '.join(map(str, written))}.")
