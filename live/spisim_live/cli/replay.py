"""Send a capture as a stream, as a rig would."""

import argparse
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from reconstruction.base.errors import InputError
from reconstruction.base.folders import output_files
from reconstruction.base.text import json_line, printable
from reconstruction.capture import CaptureFile, open_capture
from reconstruction.cli.numbers import whole_number
from reconstruction.cli.reconstruct import OVERWRITE
from spisim_live import Sender, frame_period_s
from spisim_live.links import NewFile, Outlet, outlet_to
from spisim_live.sending import SETUP_EVERY_S

SUMMARY = "capture -> its frames as a stream"
EXAMPLE = "python -m reconstruction replay flight.h5 --to tcp://localhost:5800"
AGAIN_S = 0.5


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    add = parser.add_argument
    add("capture", metavar="CAPTURE", type=Path, help="capture file")
    add(
        "--to",
        metavar="OUTLET",
        required=True,
        help="tcp://HOST:PORT, tcp-listen://:PORT, udp://HOST:PORT, serial:///dev/ttyUSB0, - (a "
        "pipe), FILE.stream",
    )
    add("--rate", metavar="HZ", type=_rate, help="frames per second (the capture's own); inf: all")
    add("--times", metavar="N", type=whole_number, default=1, help="over and over (1)")
    add("--overwrite", action="store_true", help=OVERWRITE)


def run(options: argparse.Namespace) -> None:
    """Send a capture."""
    if options.json and options.to == "-":
        raise InputError("--json and --to - both write to standard output: choose one")
    outlet = outlet_to(options.to)
    outlet.check()
    files = [outlet.output] if isinstance(outlet, NewFile) else []
    try:
        with (
            output_files(files, [options.capture], overwrite=options.overwrite),
            _whole(outlet),
        ):
            sent = _replay(options, outlet)
    except OSError as error:
        if options.to == "-" or error.filename is not None:
            raise
        raise InputError(f"{options.to}: {error.strerror or error}") from None
    finally:
        outlet.close()
    if options.json:
        print(json_line({"to": options.to, "frames": sent}))


@contextmanager
def _whole(outlet: Outlet) -> Iterator[None]:
    """Remove a file that was not finished."""
    try:
        yield
    except BaseException:
        if isinstance(outlet, NewFile):
            with suppress(OSError):
                outlet.discard()
        raise


def _replay(options: argparse.Namespace, outlet: Outlet) -> int:
    """Send all frames and return their number."""
    with open_capture(options.capture) as capture:
        period_s = frame_period_s(capture.setup) if options.rate is None else 1 / options.rate
        if np.isnan(period_s) and not isinstance(outlet, NewFile):
            raise InputError(
                f"{options.capture} has no pattern_period_s: state the frame rate with --rate"
            )
        _opened(outlet)
        send(capture, outlet, 0.0 if np.isnan(period_s) else period_s, options.times)
        return options.times * capture.frames


def send(
    capture: CaptureFile,
    outlet: Outlet,
    period_s: float,
    times: int = 1,
    *,
    clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], object] = time.sleep,
) -> None:
    """Send all frames in turn, ``period_s`` apart."""
    sender = Sender(capture.setup, capture.provenance, run=1 + secrets.randbelow(2**16 - 1))
    began_s = clock()
    setup_s = -np.inf
    for turn in range(times * capture.frames):
        due_s = began_s + turn * period_s
        if (early_s := due_s - clock()) > 0:
            wait(early_s)
        stamp = round(1e9 * (due_s - began_s))
        if due_s - setup_s >= SETUP_EVERY_S or turn == 0:
            setup_s = due_s
            outlet.send(sender.setup(stamp))
        outlet.send(sender.frame(capture.frame(turn % capture.frames), stamp))
    outlet.send(sender.end())


def _opened(outlet: Outlet, wait: Callable[[float], object] = time.sleep) -> None:
    """Open an outlet, waiting for a receiver."""
    waiting = False
    while True:
        try:
            outlet.open()
        except (ConnectionRefusedError, TimeoutError) as error:
            if not waiting:
                waiting = True
                why = f"waiting for {outlet.address}: {error.strerror or error}"
                print(printable(why), file=sys.stderr)
            wait(AGAIN_S)
        else:
            return


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = np.nan
    if not rate > 0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number of frames per second")
    return rate
