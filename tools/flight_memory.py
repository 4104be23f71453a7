"""Fit what the memory of a flight takes for granted of the errors of its maps.

    PYTHONPATH=benchmarks python tools/flight_memory.py FOLDER

FOLDER has, or gets, flights of families that the depth network learned from, with the poses of an
autopilot. ``sigma_factor`` is that of which 95 % of the pixels are within two standard deviations,
a flight as much as another. benchmarks/flight.py judges it, on other families.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from flight_judging import maps_of
from flight_sets import Flight, flights
from scipy.optimize import brentq

from reconstruction.base.arrays import Floats
from reconstruction.depth import MAX_RANGE_M
from reconstruction.depth.completion.correction import FITTED

KIND = "correlated"
WITHIN = 0.95
FROM_S = 0.35


def main() -> None:
    """Fit, and write the constant and what it rests on."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recorded", action="store_true", help="only flights that are there")
    asked = parser.parse_args()
    off = [
        deviations
        for flight in flights(asked.folder, "learned", record=not asked.recorded)
        if (deviations := deviations_of(flight)).size
    ]
    factor = brentq(lambda f: np.mean([np.mean(each < 2 * f) for each in off]) - WITHIN, 0.2, 5)
    fitted = json.loads(FITTED.read_text())
    fitted["kernel"]["sigma_factor"] = round(fitted["kernel"]["sigma_factor"] * factor, 3)
    fitted["flights"] = len(off)
    FITTED.write_text(json.dumps(fitted, indent=2) + "\n")
    print(json.dumps(fitted, indent=2))


def deviations_of(flight: Flight) -> Floats:
    """Deviations of all pixels of a flight's frames that have truth, in standard deviations."""
    capture, maps, _ = maps_of(flight, KIND)
    truth, poses = capture.truth, capture.poses
    assert truth is not None
    assert poses is not None
    off = [np.zeros(0)]
    for number in truth.frame.tolist():
        remembered, true_m = maps[number], truth.at(number).depth_m
        late = poses.time_s[number] - poses.time_s[0] > FROM_S
        if remembered is not None and remembered.estimate.sigma is not None and late:
            estimate, there = remembered.estimate, true_m < MAX_RANGE_M
            log = np.log(estimate.depth_m[there] / true_m[there])
            off.append(np.abs(log) / estimate.sigma[there])
    return np.concatenate(off)


if __name__ == "__main__":
    main()
