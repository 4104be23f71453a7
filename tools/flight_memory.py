"""Fit what the memory of a flight takes for granted of the errors of its maps.

    PYTHONPATH=benchmarks python tools/flight_memory.py FOLDER

FOLDER has, or gets, flights of families that the networks learned from, with the poses of an
autopilot. Factors of sigma are those of which 95 % of the pixels are within two standard
deviations, a flight as much as another: ``sigma_factor`` where points alone complete maps, and that
of the network that completes them, of flights that this has not learned from. benchmarks/flight.py
judges them, on other families.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from flight_judging import Made, remembered, single_frames
from flight_sets import POSE_ERRORS, flights, load, with_error
from scipy.optimize import brentq

from flight_points import SEEDS, kept_aside
from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture
from reconstruction.depth import MAX_RANGE_M
from reconstruction.depth.completion.correction import FITTED

KIND = "correlated"
WITHIN = 0.95
FROM_S = 0.35


def main() -> None:
    """Fit, and write the constants and what they rest on."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recorded", action="store_true", help="only flights that are there")
    asked = parser.parse_args()
    off: dict[str, list[Floats]] = {"kernel": [], "network": []}
    for flight in flights(asked.folder, "learned", seeds=SEEDS, record=not asked.recorded):
        capture = load(flight)
        stated, made = with_error(capture, POSE_ERRORS[KIND], flight.seed), single_frames(capture)
        if not flight.seed:
            off["kernel"].append(deviations_of(stated, without_network(made)))
        if kept_aside(flight.family, flight.seed):
            off["network"].append(deviations_of(stated, made))
    fitted = json.loads(FITTED.read_text())
    for name, every in off.items():
        some = [each for each in every if each.size]
        fitted[name]["sigma_factor"] = round(fitted[name]["sigma_factor"] * factor(some), 3)
        fitted["flights"][name] = len(some)
    FITTED.write_text(json.dumps(fitted, indent=2) + "\n")
    print(json.dumps(fitted, indent=2))


def without_network(made: Made) -> Made:
    """Maps that do not state where nothing returns, which the network is not asked of."""
    return [
        (view, whole and whole._replace(estimate=replace(whole.estimate, no_return=None)))
        for view, whole in made
    ]


def factor(deviations: Sequence[Floats]) -> float:
    """Of sigma, for deviations of pixels of flights."""
    return float(
        brentq(lambda f: np.mean([np.mean(each < 2 * f) for each in deviations]) - WITHIN, 0.2, 5)
    )


def deviations_of(capture: Capture, made: Made) -> Floats:
    """Deviations of all pixels of a flight's frames that have truth, in standard deviations."""
    truth, poses = capture.truth, capture.poses
    assert truth is not None
    assert poses is not None
    off, maps = [np.zeros(0)], list(remembered(capture, made))
    for number in truth.frame.tolist():
        with_memory, true_m = maps[number], truth.at(number).depth_m
        late = poses.time_s[number] - poses.time_s[0] > FROM_S
        if with_memory is not None and with_memory.estimate.sigma is not None and late:
            estimate, there = with_memory.estimate, true_m < MAX_RANGE_M
            log = np.log(estimate.depth_m[there] / true_m[there])
            off.append(np.abs(log) / estimate.sigma[there])
    return np.concatenate(off)


if __name__ == "__main__":
    main()
