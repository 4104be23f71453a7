"""An autopilot keeps 2 m from a wall in fog, by reconstructed ranges alone.

    python benchmarks/closed_loop.py [--quick] [--json] [--markdown]

`spisim serve` and `examples/live/keep_distance.py`, two processes in lock-step over TCP: preset
`fog`, 50 m of visibility, light traced, 117 frames a second of simulated time. The drone begins at
3 m; at 20 s a gust blows it 0.4 m off within 1.5 s, which it does not notice. It is judged by where
it truly was, which the server has recorded. A flight that the folder has is not flown again.
`--markdown` pastes the tables into docs/results/live.md and draws its picture.
"""

import csv
import socket
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from options import benchmark_options, finish

from reconstruction import Capture, Reconstructor, read_capture
from spisim_paper.checks import Check, Table, surroundings

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "results" / "live.md"
FOLDER = ROOT / "out" / "closed-loop"
PICTURE = ROOT / "docs" / "images" / "closed-loop.png"
PILOT = ROOT / "examples" / "live" / "keep_distance.py"
TARGET_M, WITHIN_M = 2.0, 0.1
SETTLING_S, SECONDS = 2.0, 62.0
QUICK_S = 5.0
GUST = "20,1.5,-0.4,0,0"
QUICK_GUST = "3,1.5,-0.4,0,0"


@dataclass(frozen=True, eq=False)
class Flight:
    """By frame (F,): time in s, true and seen distance and the latter's sigma in m, and the report.

    And ranges (F, 4) with the true ones.
    """

    time_s: np.ndarray
    true_m: np.ndarray
    seen_m: np.ndarray
    sigma_m: np.ndarray
    reported_m: np.ndarray
    range_m: np.ndarray
    true_range_m: np.ndarray

    @property
    def off_m(self) -> np.ndarray:
        """How far the drone was from where it should be, once it had settled."""
        return np.abs(self.true_m - TARGET_M)[self.time_s >= SETTLING_S]


def main() -> int:
    """Fly, judge and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, f"{QUICK_S:g} s, surrogate light", PAGE, folder=FOLDER)
    if not (options.folder / "log.csv").is_file():
        fly(options.folder, quick=options.quick)
    capture = read_capture(options.folder / "flight.h5")
    flight = read_flight(options.folder, capture)
    errors_mm = 1e3 * np.abs(flight.range_m - flight.true_range_m)
    off_mm = 1e3 * flight.off_m
    seconds = flight.time_s[-1] - SETTLING_S
    row = (
        f"{seconds:.1f}",
        str(len(flight.time_s)),
        *(f"{value:.1f}" for value in (np.sqrt(np.mean(off_mm**2)), off_mm.max())),
        *(f"{np.nanpercentile(errors_mm, fraction):.2f}" for fraction in (50, 99)),
        f"{1e3 * np.nanmedian(flight.sigma_m):.2f}",
    )
    columns = (
        *("seconds after settling", "frames", "off 2 m, RMS, mm", "most, mm"),
        *("error of a range, median, mm", "99 %, mm", "sigma of the distance, median, mm"),
    )
    checks = [
        Check(
            "seconds after settling", float(seconds), 0.0 if options.quick else 60.0, at_least=True
        ),
        Check("most that it is off 2 m, m", float(flight.off_m.max()), WITHIN_M),
        Check("frames without a distance", int(np.isnan(flight.seen_m).sum()), 0),
    ]
    title = (
        f"In 50 m of visibility, from 3 m on, with a gust of 0.4 m ({SETTLING_S:g} s to settle):"
    )
    around = surroundings(("spisim", "numpy", "scipy", "mitsuba"))
    if options.markdown:
        draw(flight, capture)
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


def read_flight(folder: Path, capture: Capture) -> Flight:
    """What was flown and what was seen of it; the wall is square ahead, and stays."""
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
        reported_m=log["told_m"],
        range_m=np.stack([log[f"range_{n}_m"] for n in range(4)], axis=1),
        true_range_m=true_m[:, None] / along,
    )


def draw(flight: Flight, capture: Capture) -> None:
    """The whole flight, the gust closer, the error of what was seen, and what the camera saw."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11, 7), layout="constrained")
    grid = figure.add_gridspec(3, 4, height_ratios=(1.2, 1.2, 1))
    gust_s = float(GUST.partition(",")[0])
    whole, reported = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3])
    gust, error = figure.add_subplot(grid[1, :2]), figure.add_subplot(grid[1, 2:])
    draw_distance(whole, flight, 0.0, flight.time_s[-1])
    whole.legend(fontsize="small", ncols=3)
    whole.set(title="distance of the wall, m")
    draw_distance(gust, flight, gust_s - 0.5, gust_s + 3.0)
    gust.set(title="the same about the gust, m")
    reported.plot(flight.time_s, flight.reported_m, color="C2", linewidth=1)
    reported.set(title="reported distance ahead, m", xlabel="s")
    off_mm = 1e3 * (flight.seen_m - flight.true_m)
    error.plot(flight.time_s, off_mm, ",", color="C1")
    for side in (-2, 2):
        error.plot(flight.time_s, side * 1e3 * flight.sigma_m, color="k", linewidth=0.8)
    error.set(title="distance seen less the true one, and ± 2 sigma, mm", xlabel="s")
    reconstruct = Reconstructor(capture.setup)
    frames = np.searchsorted(flight.time_s, (0.0, 0.5, 2.0, gust_s + 0.75)).tolist()
    images = [reconstruct(capture.frame(frame)).image for frame in frames]
    brightest = max(image.max() for image in images)
    for column, (frame, image) in enumerate(zip(frames, images, strict=True)):
        axis = figure.add_subplot(grid[2, column])
        axis.imshow(image, cmap="gray", vmin=0, vmax=brightest)
        reported_s, true_m = flight.time_s[frame], flight.true_m[frame]
        axis.set(title=f"{reported_s:.2f} s, at {true_m:.2f} m", xticks=[], yticks=[])
    figure.savefig(PICTURE, dpi=90, metadata={"Software": None})


def draw_distance(axis: Any, flight: Flight, start_s: float, stop_s: float) -> None:
    """Where the drone was and what it saw, over some of the time."""
    some = (flight.time_s >= start_s) & (flight.time_s <= stop_s)
    time_s, seen_m, sigma_m = flight.time_s[some], flight.seen_m[some], flight.sigma_m[some]
    axis.axhspan(TARGET_M - WITHIN_M, TARGET_M + WITHIN_M, color="0.9", label="2 m ± 0.1 m")
    axis.plot(time_s, flight.true_m[some], color="k", linewidth=2, label="true distance")
    axis.plot(time_s, seen_m, color="C1", linewidth=0.8, label="as seen, ± 3 sigma")
    low_m, high_m = seen_m - 3 * sigma_m, seen_m + 3 * sigma_m
    axis.fill_between(time_s, low_m, high_m, color="C1", alpha=0.4, linewidth=0)
    axis.set(xlabel="s", xlim=(start_s, stop_s))


if __name__ == "__main__":
    sys.exit(main())
