"""Fit what the memory of a flight takes for granted of its errors: sigma and the corridor.

    PYTHONPATH=benchmarks python tools/flight_memory.py FOLDER

FOLDER has, or gets, flights of families that the depth network learned from, with the poses of an
autopilot. ``sigma_factor`` is that of which 95 % of the pixels are within two standard deviations,
a flight as much as another; the constants of the corridor are those of least cross entropy, as
tools/corridor_priors.py fits them. Both are judged by benchmarks/flight.py, on other families.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from flight_judging import maps_of
from flight_sets import Flight, flights
from scipy.optimize import brentq, minimize
from scipy.special import expit

from corridor_priors import FROM_M, MIN, SCALES, Ahead, truly_free
from reconstruction.base.arrays import Floats
from reconstruction.depth import DISTANCES_M, MAX_RANGE_M, Corridor, pixel_rays
from reconstruction.depth.memory.correction import FITTED as KERNEL
from reconstruction.depth.memory.obstacles import (
    Met,
    MetObstacles,
    free_of_met,
    met_in_corridor,
)
from reconstruction.depth.methods.flight import corridors
from reconstruction.depth.obstacle import FITTED as CORRIDOR
from reconstruction.depth.obstacle import CorridorPrior, free_of

MAP_SIGMA = 0.3
ONE = CorridorPrior(0, 1, 1, 0, MAP_SIGMA)
"""Its sigma is the fraction that is left."""
KIND = "correlated"
WITHIN = 0.95
FROM_S = 0.35


def main() -> None:
    """Fit, and write constants and what they rest on."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recorded", action="store_true", help="only flights that are there")
    asked = parser.parse_args()
    off: list[Floats] = []
    aheads: list[Ahead] = []
    met: list[Met] = []
    left: list[float] = []
    for flight in flights(asked.folder, "learned", record=not asked.recorded):
        of_flight = list(judged(flight))
        if of_flight:
            off.append(np.concatenate([each[0] for each in of_flight]))
            aheads += [each[1] for each in of_flight]
            met += [each[2] for each in of_flight]
            left += [each[3] for each in of_flight]
            print(flight.path.stem, flush=True)
    factor = brentq(lambda f: np.mean([np.mean(each < 2 * f) for each in off]) - WITHIN, 0.2, 5)
    kernel = json.loads(KERNEL.read_text())
    kernel["kernel"]["sigma_factor"] = round(kernel["kernel"]["sigma_factor"] * factor, 3)
    prior, obstacles = fit(aheads, met, np.array(left))
    kernel |= {"obstacles": asdict(obstacles), "flights": len(off)}
    KERNEL.write_text(json.dumps(kernel, indent=2) + "\n")
    priors = json.loads(CORRIDOR.read_text())
    families = sorted({each.family for each in aheads})
    priors["flight"] = {"prior": asdict(prior), "learn": {"families": families, "maps": len(met)}}
    CORRIDOR.write_text(json.dumps(priors, indent=2) + "\n")
    print(json.dumps({"kernel": kernel, "corridor": priors["flight"]}, indent=2))


def judged(flight: Flight) -> Iterator[tuple[Floats, Ahead, Met, float]]:
    """Deviations in sigmas, map, points and sigma left of a flight's frames that have truth."""
    capture, maps, made = maps_of(flight, KIND)
    truth, poses = capture.truth, capture.poses
    assert truth is not None
    assert poses is not None
    assert capture.optics is not None
    rays = pixel_rays(capture.optics, capture.plan.shape)
    corridor = Corridor(rays)
    for number in truth.frame.tolist():
        remembered, whole, true = maps[number], made[number], truth.at(number)
        late = poses.time_s[number] - poses.time_s[0] > FROM_S
        if remembered is None or whole is None or remembered.estimate.sigma is None or not late:
            continue
        estimate, there = remembered.estimate, true.depth_m < MAX_RANGE_M
        log = np.log(estimate.depth_m[there] / true.depth_m[there])
        ahead = Ahead(flight.family, corridor, estimate, float(true.corridor_m))
        left = corridors(remembered, whole, rays).left
        surer = (
            1.0 if left is None else ONE.surer(corridor.mean_inside(estimate.depth_m, left)).sigma
        )
        met = met_in_corridor(remembered.points)
        yield np.abs(log) / estimate.sigma[there], ahead, met, surer


def fit(aheads: list[Ahead], met: list[Met], left: Floats) -> tuple[CorridorPrior, MetObstacles]:
    """Constants of least cross entropy of the probability that the corridor is free."""
    free = truly_free(aheads)[:, DISTANCES_M >= FROM_M]
    best: tuple[float, Floats, float] | None = None

    def constants(x: Floats, scale: float) -> tuple[CorridorPrior, MetObstacles]:
        prior = CorridorPrior(x[0], scale, np.exp(x[1]), float(expit(x[2])), MAP_SIGMA)
        return prior, MetObstacles(float(expit(x[3])), float(np.exp(x[4])))

    for scale in SCALES:
        ensembles = np.array([each.ensemble_m(scale, MAP_SIGMA) for each in aheads])

        def entropy(x: Floats, ensembles: Floats = ensembles, scale: float = scale) -> float:
            prior, obstacles = constants(x, scale)
            of_maps = [
                free_of(each, replace(prior, sigma=prior.sigma * some))
                for each, some in zip(ensembles, left, strict=True)
            ]
            stated = of_maps * np.array([free_of_met(each, obstacles) for each in met])
            stated = stated[:, DISTANCES_M >= FROM_M].clip(MIN, 1 - MIN)
            return -float((free * np.log(stated) + (1 - free) * np.log(1 - stated)).mean())

        start = [0.0, -2.0, -3.0, 2.0, 0.5]
        result = minimize(entropy, start, method="Nelder-Mead", options={"maxfev": 150})
        if best is None or result.fun < best[0]:
            best = result.fun, result.x, scale
    assert best is not None
    prior, obstacles = constants(best[1], best[2])
    return (
        CorridorPrior(**{n: float(f"{v:.3g}") for n, v in asdict(prior).items()}),
        MetObstacles(**{n: float(f"{v:.3g}") for n, v in asdict(obstacles).items()}),
    )


if __name__ == "__main__":
    main()
