"""Fit what the memory of a flight takes for granted of its errors: sigma and the corridor.

    PYTHONPATH=benchmarks python tools/flight_memory.py FOLDER

FOLDER has, or gets, flights of families that the depth network learned from, with the poses of an
autopilot. ``sigma_factor`` is that of which 95 % of the pixels are within two standard deviations,
a flight as much as another; the constants of the corridor are those of least cross entropy, as
tools/corridor_priors.py fits them. Both are judged by benchmarks/flight.py, on other families.
"""

import argparse
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
from flight_judging import maps_of
from flight_sets import flights

from corridor_priors import Ahead, fitted, report
from reconstruction.depth import Corridor, pixel_rays
from reconstruction.depth.memory.correction import FITTED as KERNEL
from reconstruction.depth.obstacle import FITTED as CORRIDOR

KIND = "correlated"
WITHIN = 0.95
FROM_S = 0.35


def main() -> None:
    """Fit, and write constants and what they rest on."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recorded", action="store_true", help="only flights that are there")
    asked = parser.parse_args()
    deviations: list[float] = []
    aheads: list[Ahead] = []
    for flight in flights(asked.folder, "learned", record=not asked.recorded):
        capture, maps = maps_of(flight, KIND)
        truth, poses = capture.truth, capture.poses
        assert truth is not None
        assert poses is not None
        assert capture.optics is not None
        corridor = Corridor(pixel_rays(capture.optics, capture.plan.shape))
        off = []
        for number in truth.frame.tolist():
            estimate, true = maps[number], truth.at(number)
            if estimate is None or estimate.sigma is None:
                continue
            if poses.time_s[number] - poses.time_s[0] < FROM_S:
                continue
            there = np.isfinite(true.depth_m)
            log = np.log(estimate.depth_m[there] / true.depth_m[there])
            off.append(np.abs(log) / estimate.sigma[there])
            aheads.append(Ahead(flight.family, corridor, estimate, float(true.corridor_m)))
        if off:
            deviations.append(float(np.quantile(np.concatenate(off), WITHIN)) / 2)
        print(flight.path.stem, f"{deviations[-1]:.2f}", flush=True)
    kernel = json.loads(KERNEL.read_text())
    kernel["kernel"]["sigma_factor"] *= round(float(np.mean(deviations)), 3)
    kernel["flights"] = len(deviations)
    KERNEL.write_text(json.dumps(kernel, indent=2) + "\n")
    priors = json.loads(CORRIDOR.read_text())
    prior = fitted(aheads, (0.3,))
    priors["flight"] = {"prior": asdict(prior), "learn": report(aheads, prior)}
    CORRIDOR.write_text(json.dumps(priors, indent=2) + "\n")
    print(json.dumps({"kernel": kernel, "corridor": priors["flight"]}, indent=2))


if __name__ == "__main__":
    main()
