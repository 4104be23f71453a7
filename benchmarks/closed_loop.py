"""An autopilot keeps 2 m from a wall in fog, by reconstructed ranges alone.

    python benchmarks/closed_loop.py [--quick] [--json] [--markdown]

`spisim serve` and `examples/live/keep_distance.py`, two processes in lock-step over TCP: preset
`fog`, 50 m of visibility, light traced, 117 frames a second of simulated time. The drone begins at
3 m; at 20 s a gust blows it 0.4 m off within 1.5 s, which it does not notice. It is judged by where
it truly was, which the server has recorded. `--markdown` pastes the tables into docs/live.md;
`python tools/closed_loop_plot.py` draws the flight that is left in the folder.
"""

import csv
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from options import benchmark_options, finish

from reconstruction import read_capture
from spisim.paper.checks import Check, Table, surroundings

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "live.md"
FOLDER = ROOT / "out" / "closed-loop"
PILOT = ROOT / "examples" / "live" / "keep_distance.py"
KEPT_M, WITHIN_M = 2.0, 0.1
SETTLING_S, SECONDS = 2.0, 62.0
QUICK_S = 5.0
GUST = "20,1.5,-0.4,0,0"
QUICK_GUST = "3,1.5,-0.4,0,0"


@dataclass(frozen=True, eq=False)
class Flight:
    """By frame (F,): time in s, true and seen distance and the latter's sigma in m, what was told.

    And ranges (F, 4) with the true ones.
    """

    time_s: np.ndarray
    true_m: np.ndarray
    seen_m: np.ndarray
    sigma_m: np.ndarray
    told_m: np.ndarray
    range_m: np.ndarray
    true_range_m: np.ndarray

    @property
    def off_m(self) -> np.ndarray:
        """How far the drone was from where it should be, once it had settled."""
        return np.abs(self.true_m - KEPT_M)[self.time_s >= SETTLING_S]


def main() -> int:
    """Fly, judge, print, and tell by the exit status whether every promise is kept."""
    options = benchmark_options(__doc__, f"{QUICK_S:g} s, surrogate light", PAGE, folder=FOLDER)
    began_s = time.monotonic()
    fly(options.folder, quick=options.quick)
    flight = read_flight(options.folder)
    errors_mm = 1e3 * np.abs(flight.range_m - flight.true_range_m)
    off_mm = 1e3 * flight.off_m
    seconds = flight.time_s[-1] - SETTLING_S
    row = (
        f"{seconds:.1f}",
        str(len(flight.time_s)),
        *(f"{value:.1f}" for value in (np.sqrt(np.mean(off_mm**2)), off_mm.max())),
        *(f"{np.nanpercentile(errors_mm, share):.2f}" for share in (50, 99)),
        f"{1e3 * np.nanmedian(flight.sigma_m):.2f}",
        f"{time.monotonic() - began_s:.0f}",
    )
    columns = (
        *("seconds after settling", "frames", "off 2 m, RMS, mm", "most, mm"),
        *("error of a range, median, mm", "99 %, mm", "sigma of the distance, median, mm"),
        "wall clock, s",
    )
    checks = [
        Check("seconds after settling", seconds, 0.0 if options.quick else 60.0, at_least=True),
        Check("most that it is off 2 m, m", flight.off_m.max(), WITHIN_M),
        Check("frames without a distance", np.isnan(flight.seen_m).sum(), 0),
    ]
    title = (
        f"In 50 m of visibility, from 3 m on, with a gust of 0.4 m ({SETTLING_S:g} s to settle):"
    )
    around = surroundings(("spisim", "numpy", "scipy", "mitsuba"))
    return finish(options, PAGE, "closed-loop", around, [Table(title, columns, [row])], checks)


def fly(folder: Path, *, quick: bool) -> None:
    """Leave the flight in a folder: flight.h5, flight.csv and log.csv."""
    folder.mkdir(parents=True, exist_ok=True)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    serving = [sys.executable, "-m", "spisim", "serve", "target-plane", "--pose", "1,0,1.5"]
    serving += ["--instrument", "fog", "--visibility", "50", "--lockstep"]
    serving += ["--to", f"tcp-listen://{address}", "--gust", QUICK_GUST if quick else GUST]
    serving += ["--light", "surrogate" if quick else "traced", "--truths", "117"]
    serving += ["--record", str(folder / "flight.h5"), "--overwrite"]
    pilot = [sys.executable, str(PILOT), f"tcp://{address}", "--log", str(folder / "log.csv")]
    pilot += ["--seconds", str(QUICK_S if quick else SECONDS)]
    with subprocess.Popen(serving, cwd=ROOT) as server:
        try:
            subprocess.run(pilot, cwd=ROOT, check=True)
        finally:
            if server.wait(600):
                raise SystemExit("spisim serve has failed")


def read_flight(folder: Path) -> Flight:
    """What was flown and what was seen of it; the wall is square ahead, and stays."""
    capture = read_capture(folder / "flight.h5")
    with (folder / "log.csv").open(encoding="ascii") as file:
        names, *rows = list(csv.reader(file))
    log = dict(zip(names, np.array(rows, float).T, strict=True))
    flown = np.loadtxt(folder / "flight.csv", delimiter=",", skiprows=2)
    middle_x_m = (flown[:-1, 1] + flown[1:, 1]) / 2
    assert capture.truth is not None
    assert capture.spots is not None
    along = capture.spots.directions[:, 2]
    wall_x_m = middle_x_m[0] + np.mean(capture.truth.spot_range_m[0] * along)
    true_m = wall_x_m - middle_x_m
    return Flight(
        time_s=log["time_s"],
        true_m=true_m,
        seen_m=log["distance_m"],
        sigma_m=log["sigma_m"],
        told_m=log["told_m"],
        range_m=np.stack([log[f"range_{n}_m"] for n in range(4)], axis=1),
        true_range_m=true_m[:, None] / along,
    )


if __name__ == "__main__":
    sys.exit(main())
