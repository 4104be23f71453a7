"""An autopilot in few lines: keeps its distance from a wall, by reconstructed ranges alone.

    spisim serve target-plane --instrument fog --visibility 50 --lockstep --gust 20,1.5,-0.4,0,0
    python examples/live/keep_distance.py tcp://localhost:5800 --seconds 60

It asks for a frame, reconstructs it, and tells the drone where to be during the next one: farther
ahead or back, by how far the wall is from where it should be. It sees what a rig sends, and nothing
of where the drone really is. Over a rig's own link it would do the same.
"""

import argparse
import csv
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from reconstruction.base.errors import InputError
from spisim_live import Kind, Loop, Message, Outcome, Pose, Reception, command, pack
from spisim_live.links import Outlet, Source, source_at

TARGET_M = 2.0
GAIN_PER_S = 8.0
"""An error goes to 1/e in an eighth of a second; 117 frames a second would bear 50 of it."""
MAX_M_S = 1.0
PATIENCE_S = 60.0
"""Until a frame is asked for again: light at a new place may have to be traced first."""
COLUMNS = ("time_s", "told_m", "distance_m", "sigma_m", *(f"range_{n}_m" for n in range(4)))


class Autopilot:
    """Sends a command for each frame; `rows` are what it has seen and told, by `COLUMNS`."""

    def __init__(self, send: Callable[[bytes], None], seconds: float, clock=time.monotonic) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.over = False
        self._send = send
        self._seconds = seconds
        self._clock = clock
        self._ahead_m = 0.0
        self._time_s = 0.0
        self._asked_s = -np.inf
        self._next = 0

    def ask(self, number: int | None = None) -> None:
        """Ask for a frame, or again for the one that has not come."""
        self._next = self._next if number is None else number
        self._asked_s = self._clock()
        self._send(command(Pose((self._ahead_m, 0.0, 0.0)), self._next))

    def ask_again(self, *, reconnected: bool) -> None:
        """Where an answer is overdue: it, or the command, was lost."""
        if reconnected or self._clock() - self._asked_s > PATIENCE_S:
            self.ask()

    def see(self, outcome: Outcome) -> None:
        """A frame: correct the place, and ask for the next."""
        time_s = 1e-9 * outcome.time_ns
        ranges = outcome.result.ranges
        distance_m, sigma_m = distance(ranges, outcome.stream.setup.spots.directions)
        if np.isfinite(distance_m):
            wanted_m_s = GAIN_PER_S * (distance_m - TARGET_M)
            self._ahead_m += np.clip(wanted_m_s, -MAX_M_S, MAX_M_S) * (time_s - self._time_s)
        self._time_s = time_s
        self.rows.append((time_s, self._ahead_m, distance_m, sigma_m, *ranges.range_m))
        self.over = time_s >= self._seconds
        if self.over:
            self._send(pack(Message(Kind.END)))
        else:
            self.ask(outcome.result.frame + 1)


def distance(ranges, directions) -> tuple[float, float]:
    """Of a wall square ahead, and its standard deviation, m; nan where no spot tells it."""
    sound = ranges.valid
    if not sound.any():
        return np.nan, np.nan
    along = directions[sound, 2]
    weights = 1 / (along * ranges.sigma_m[sound]) ** 2
    return float(weights @ (along * ranges.range_m[sound]) / weights.sum()), weights.sum() ** -0.5


def fly(link: Source, seconds: float) -> Autopilot:
    """Keep the distance for so many seconds of the stream's own time."""
    assert isinstance(link, Outlet)
    reception = Reception(link)
    pilot = Autopilot(link.send, seconds)
    loop = Loop(
        reception,
        image="zero-filled",
        ranging="fog",
        depth="nearest",
        results=[pilot.see],
        states=[lambda state: tell(pilot)],
    )
    with ExitStack() as ending:
        receiving = threading.Thread(target=reception.run, daemon=True)
        receiving.start()
        ending.callback(reception.stop)
        while reception.stream is None and not reception.over:
            loop.step(0.05)
        if reception.failure is None:
            pilot.ask(0)
        connections = reception.counts.connections
        while not (pilot.over or (reception.over and reception.queue.over)):
            loop.step(0.05)
            previous, connections = connections, reception.counts.connections
            pilot.ask_again(reconnected=connections > previous)
    if reception.failure is not None:
        raise reception.failure
    return pilot


def tell(pilot: Autopilot) -> None:
    """Once a second."""
    if pilot.rows:
        time_s, commanded_m, distance_m, sigma_m, *_ = pilot.rows[-1]
        print(
            f"{time_s:6.2f} s: {distance_m:.3f} m, sigma {1e3 * sigma_m:.1f} mm; "
            f"told to be {commanded_m:+.3f} m ahead",
            file=sys.stderr,
        )


def main() -> int:
    """Fly, and tell how far the wall seemed to be once that had settled."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("address", help="as tcp://localhost:5800")
    parser.add_argument("--seconds", type=float, default=60.0, help="how long (60)")
    parser.add_argument("--log", type=Path, help="write what was seen and told, CSV")
    options = parser.parse_args()
    try:
        link = source_at(options.address)
        if not isinstance(link, Outlet):
            raise InputError(f"{options.address}: commands cannot go back there")
        pilot = fly(link, options.seconds)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if options.log is not None:
        with options.log.open("w", newline="", encoding="ascii") as file:
            csv.writer(file).writerows([COLUMNS, *pilot.rows])
    off_m = [abs(row[2] - TARGET_M) for row in pilot.rows]
    settled = next((n for n, each in enumerate(off_m) if each < 0.1), len(off_m))
    print(f"{len(off_m)} frames, settled after {settled}; as it saw it, never farther off than")
    print(f"{1e3 * max(off_m[settled:], default=np.nan):.0f} mm since.")
    return 0 if pilot.over else 1


if __name__ == "__main__":
    sys.exit(main())
