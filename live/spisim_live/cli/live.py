"""Reconstruct a live stream."""

import argparse
import math
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from reconstruction.base.errors import InputError, in_words
from reconstruction.base.text import json_line, printable
from reconstruction.cli.numbers import whole_number
from reconstruction.cli.reconstruct import MIN_FREE_OPTION, OVERWRITE, STATIONS, WEATHER, names
from reconstruction.image import load_pursuit
from reconstruction.ranging import RANGED
from spisim_live import CaptureSource, Counts, Loop, Outcome, Reception, State
from spisim_live.links import Source, is_link, source_at
from spisim_live.mavlink import PoseSigmas, PoseSource
from spisim_live.sinks import Detached, Sink, sink_to
from spisim_live.sinks.lines import state_report

SUMMARY = "frames as they come -> results as they go"
EXAMPLE = "python -m reconstruction live tcp-listen://:5800 --to latest --to flight.h5"
SINKS = (
    "FOLDER (the latest result), FILE.h5 (captures), FILE.stream (frames as they came), "
    "FILE.jsonl or - (results, a line each), FILE.mcap (messages of ROS 2), an address as for "
    "SOURCE (results), mavlink:CONNECTION (ranges and obstacles for an autopilot), window"
)

MIN_WAIT_S = 1.0
"""Minimum waiting time that is printed."""
EXPECTED = ("received", "reconstructed", "connections")
PURSUING = ("pursuit", "usual", "all")
"""Parts of the names that select pursuit methods."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    add = parser.add_argument
    add(
        "source",
        metavar="SOURCE",
        help="tcp://HOST:PORT, tcp-listen://:PORT, udp://:PORT, serial:///dev/ttyUSB0?baud=921600, "
        "- (a pipe), or a file: a stream or a capture",
    )
    add("--to", metavar="SINK", action="append", default=[], help=f"{SINKS}; several of them")
    add("--follow", action="store_true", help="wait for a file to grow")
    add("--frames", metavar="N", type=whole_number, help="end after so many results")
    add("--waiting", metavar="N", type=whole_number, default=16, help="frames that may wait (16)")
    add("--reorder", metavar="N", type=_window, default=1, help="frames to hold for an earlier (1)")
    for station, methods in STATIONS.items():
        add(
            f"--{station}",
            metavar="METHOD[,METHOD]",
            help=f"methods, the default one first: {', '.join(methods)}",
        )
    add(
        "--poses",
        metavar="CONNECTION",
        help="poses from an autopilot by MAVLink, as udp:14550, tcp:HOST:PORT, /dev/ttyACM0,57600 "
        "or FILE.tlog",
    )
    add(
        "--pose-sigma",
        metavar="M,DEG",
        type=_sigmas,
        help="standard deviations of position and attitude where the autopilot states none",
    )
    add(
        "--pose-offset",
        metavar="S",
        type=_seconds,
        help="to add to the frames' time stamps before poses are sought; a .tlog counts from 1970 "
        "(0)",
    )
    add("--weather", metavar="WEATHER", help=WEATHER)
    add("--min-free", **MIN_FREE_OPTION)
    add("--quiet", action="store_true", help="do not print the state each second")
    add("--overwrite", action="store_true", help=OVERWRITE)


def run(options: argparse.Namespace) -> None:
    """Reconstruct a stream until it ends, or is interrupted."""
    with ExitStack() as held:
        _run(options, _sinks(options, held))


def _run(options: argparse.Namespace, sinks: list[tuple[str, Sink]]) -> None:
    source = _source(options.source, followed=options.follow)
    poses = _pose_source(options)
    counts = Counts()
    detached = [Detached(sink, name, counts) for name, sink in sinks]
    reception = Reception(
        source,
        waiting=options.waiting,
        window=options.reorder,
        poses=poses,
        recorders=[each.frame for each in detached],
        counts=counts,
    )
    printer = _StatusPrinter(detached, poses, quiet=options.quiet)
    loop = Loop(
        reception,
        results=[printer.result, *(each.result for each in detached)],
        states=[printer.state, *(each.state for each in detached)],
        image=names(options.image),
        ranging=names(options.ranging),
        depth=names(options.depth),
        weather=options.weather,
        min_free=options.min_free,
    )
    if any(name in (options.image or "") for name in PURSUING):
        load_pursuit()
    with _running(reception, detached, poses):
        loop.run(options.frames)
    if poses is not None and poses.missing:
        print(printable(f"warning: {_without_pose(poses)}"), file=sys.stderr)
    for each in detached:
        if each.lost and not each.failed:
            print(printable(f"warning: {each.why}; lost {each.lost}"), file=sys.stderr)
        if each.dropped:
            print(printable(f"warning: {each.name}: dropped {each.dropped}"), file=sys.stderr)
    failed = [f"{each.why}; lost {each.lost}" for each in detached if each.failed]
    if loop.ended is not None:
        failed.append(f"a method raised {loop.ended}")
    if failed:
        raise InputError("; ".join(failed))
    if not reception.counts.reconstructed:
        raise InputError(f"{options.source}: no frame was reconstructed{_why(loop.state())}")
    if options.json:
        lost = {each.name: {"lost": each.lost, "dropped": each.dropped} for each in detached}
        located = {} if poses is None else {"located": poses.located, "without_pose": poses.missing}
        print(json_line({**state_report(loop.state()), **located, "sinks": lost}))


def _sinks(options: argparse.Namespace, held: ExitStack) -> list[tuple[str, Sink]]:
    """Sinks by name, all ready, with what is ``held`` for them."""
    if options.json and "-" in options.to:
        raise InputError("--json and --to - both write to standard output: choose one")
    outputs = [Path(name).parent.resolve() / Path(name).name for name in options.to]
    for number, name in enumerate(options.to):
        if outputs[number] in outputs[:number]:
            raise InputError(f"--to {name} is given twice")
    read = [Path(name) for name in (options.source, options.poses) if name and not is_link(name)]
    sinks = [(name, sink_to(name, read, overwrite=options.overwrite)) for name in options.to]
    for _, sink in sinks:
        held.enter_context(sink.ready())
    return sinks


def _pose_source(options: argparse.Namespace) -> PoseSource | None:
    """Source of poses beside the stream, opened."""
    if options.poses is None:
        for option in ("pose_sigma", "pose_offset"):
            if getattr(options, option) is not None:
                raise InputError(f"--{option.replace('_', '-')} goes with --poses")
        return None
    return PoseSource(
        options.poses,
        sigmas=options.pose_sigma or PoseSigmas(),
        offset_s=options.pose_offset or 0.0,
    )


def _without_pose(poses: PoseSource) -> str:
    trouble = f"; {poses.trouble}" if poses.trouble else ""
    return f"{poses.missing} frames have no pose{trouble}"


@contextmanager
def _running(
    reception: Reception, detached: list[Detached], poses: PoseSource | None
) -> Iterator[None]:
    """Run the threads that receive and write; an interrupt ends the stream."""
    receiving = threading.Thread(target=reception.run, name="reception", daemon=True)
    for each in detached:
        each.start()
    if poses is not None:
        threading.Thread(target=poses.run, name="poses", daemon=True).start()
    receiving.start()
    try:
        with _interrupts():
            yield
    except KeyboardInterrupt:
        print(file=sys.stderr)
    finally:
        reception.stop()
        receiving.join(5.0)
        if poses is not None:
            poses.stop()
        for each in detached:
            each.close()


@contextmanager
def _interrupts() -> Iterator[None]:
    """Tell Ctrl-C from a KeyboardInterrupt of a method, which is an error."""
    watched = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not watched or threading.current_thread() is not threading.main_thread():
        yield
        return
    pressed = threading.Event()

    def press(*_: object) -> None:
        pressed.set()
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, press)
    try:
        yield
    except KeyboardInterrupt as error:
        if pressed.is_set():
            raise
        raise InputError(f"a method raised {in_words(error)}") from error
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _source(address: str, *, followed: bool) -> Source:
    path = Path(address)
    if not is_link(address) and (path.suffix.lower() in (".h5", ".hdf5") or path.is_dir()):
        return CaptureSource(path, followed=followed, wait=time.sleep)
    return source_at(address, followed=followed)


class _StatusPrinter:
    """Prints the state of the stream."""

    def __init__(self, detached: list[Detached], poses: PoseSource | None, *, quiet: bool) -> None:
        self._detached = detached
        self._poses = poses
        self._quiet = quiet
        self._latest: Outcome | None = None

    def result(self, outcome: Outcome) -> None:
        self._latest = outcome

    def state(self, state: State) -> None:
        if self._quiet:
            return
        with suppress(OSError):  # nobody reads stderr
            print(printable("; ".join(self._words(state))), file=sys.stderr)

    def _words(self, state: State) -> Iterator[str]:
        if self._latest is None:
            yield "no frame yet"
        else:
            latest = self._latest.result
            yield f"frame {latest.frame}, {state.age_s:.1f} s old"
            yield (
                f"{state.frames_per_s:.0f} frames/s, latency {1e3 * state.latency_s:.1f} ms, "
                f"99 % below {1e3 * state.latency_99_s:.1f} ms"
            )
            if latest.ranges is not None:
                spots = zip(latest.ranges.range_m, latest.ranges.status, strict=True)
                yield "ranges " + ", ".join(
                    f"{range_m:.2f} m" if status in RANGED else status for range_m, status in spots
                )
        if state.waiting_s >= MIN_WAIT_S:
            yield f"waiting for {state.waiting_for} for {state.waiting_s:.1f} s"
        yield from (each for each in (_fault_counts(state), state.trouble) if each)
        if self._poses is not None and self._poses.trouble:
            yield self._poses.trouble
        for each in self._detached:
            if each.trouble is not None:
                yield each.trouble
            if each.dropped:
                yield f"{each.name}: dropped {each.dropped}"


def _why(state: State) -> str:
    reasons = [each for each in (state.trouble, _fault_counts(state)) if each]
    return f": {'; '.join(reasons)}" if reasons else ""


def _fault_counts(state: State) -> str:
    """Counts that should be 0."""
    counts = vars(state.counts).items()
    return ", ".join(f"{name} {value}" for name, value in counts if value and name not in EXPECTED)


def _window(text: str) -> int:
    if not (text.isascii() and text.isdigit()) or int(text) > 64:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to 64")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds")
    return seconds


def _sigmas(text: str) -> PoseSigmas:
    try:
        position_m, attitude_deg = map(float, text.split(","))
    except ValueError:
        position_m = attitude_deg = math.nan
    if not (0 <= position_m < math.inf and 0 <= attitude_deg <= 180):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not two numbers, metres and degrees of at most 180, as in 0.05,1"
        )
    return PoseSigmas(position_m, math.radians(attitude_deg))
