"""Fit what the probability of a free corridor takes for granted of depth maps.

    python tools/depth_frames.py LEARN --scenes 5000 6000
    python tools/depth_frames.py JUDGE --plan PLAN_OF_OTHER_FAMILIES
    python tools/corridor_priors.py LEARN JUDGE

LEARN has scenes that the network of `learned` did not learn from, JUDGE those of families that
nothing learned from. The constants are those of least cross entropy of "free up to there", over
frames and distances; those of other maps are fitted to the anchored map and to the nearest spot, on
the ranges of target and fog fitted together. Writes constants, and how reliable
the probabilities are, into reconstruction/depth/corridor_priors.json.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from depth_frames import from_arrays
from reconstruction.base.arrays import Floats
from reconstruction.depth import DISTANCES_M, Corridor, DepthEstimate, pixel_of, pixel_rays
from reconstruction.depth.kriging import anchored_depth, fitted_prior
from reconstruction.depth.methods.learned import shipped
from reconstruction.depth.methods.nearest import METHOD as NEAREST
from reconstruction.depth.network_input import NetworkInput, inputs_of
from reconstruction.depth.obstacle import FITTED, CorridorPrior, free_of
from reconstruction.depth.pixels import range_over_depth

SCALES = (0.25, 0.35, 0.5, 0.7, 1.0)
MAP_SIGMAS = (0.1, 0.2, 0.3)
FROM_M = 0.5
"""What is nearer is free in all frames."""
MIN = 1e-3
"""A probability counts as no smaller."""
BINS = 10


@dataclass(frozen=True, eq=False)
class Ahead:
    """A map, and what is truly in its corridor."""

    family: str
    corridor: Corridor
    estimate: DepthEstimate
    true_m: float

    def ensemble_m(self, scale: float, map_sigma: float) -> Floats:
        """Nearest obstacles of the ensemble."""
        depth_m, std = self.estimate.depth_m, self.estimate.sigma
        sigma = np.full(depth_m.shape, map_sigma) if std is None else std
        return self.corridor.ensemble_m(depth_m, scale * sigma, self.estimate.no_return)


def main() -> None:
    """Fit, and write constants and what they rest on."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("learn", type=Path)
    parser.add_argument("judge", type=Path)
    asked = parser.parse_args()
    learn, judge = of(asked.learn), of(asked.judge)
    manifest = {}
    for name, map_sigmas in (("learned", MAP_SIGMAS[-1:]), ("others", MAP_SIGMAS)):
        prior = fitted(learn[name], map_sigmas)
        manifest[name] = {
            "prior": asdict(prior),
            "learn": report(learn[name], prior),
            "judge": report(judge[name], prior),
        }
    text = json.dumps(manifest, indent=2)
    FITTED.write_text(text + "\n")
    print(text)


def of(folder: Path) -> dict[str, list[Ahead]]:
    """The maps of a folder's frames."""
    maps: dict[str, list[Ahead]] = {"learned": [], "others": []}
    for file in sorted(folder.glob("*.npz")):
        with np.load(file) as arrays:
            columns = {name: arrays[name] for name in arrays.files}
        for number, family in enumerate(columns["family"].tolist()):
            displayed = from_arrays({name: values[number] for name, values in columns.items()})
            if not (displayed.ranged and np.percentile(displayed.image, 90) > 0):
                continue
            corridor = Corridor(pixel_rays(displayed.optics, displayed.image.shape))
            true_m = corridor.nearest_m(columns["depth_m"][number].astype(np.float64))
            for name, estimate in estimates(displayed):
                maps[name].append(Ahead(family, corridor, estimate, true_m))
    return maps


def estimates(displayed: NetworkInput) -> Iterator[tuple[str, DepthEstimate]]:
    """Maps of a frame, by which constants are theirs."""
    inputs = inputs_of(displayed)
    if shipped().out_of_distribution(inputs) is None:
        reported = shipped()(inputs)
        yield (
            "learned",
            DepthEstimate(np.exp(reported.log_depth), reported.sigma, reported.no_return),
        )
    shape = displayed.image.shape
    positions = pixel_of(displayed.directions, displayed.optics, shape)
    depth_m = np.exp(displayed.best.log_depth)
    with np.errstate(invalid="ignore"):
        sigma_m = displayed.best.log_sigma * depth_m
        result = anchored_depth(displayed.image, positions, depth_m, sigma_m, fitted_prior())
    if result is not None:
        yield "others", result
    range_m = NEAREST.ranges(shape, positions, depth_m / displayed.directions[:, 2])
    if range_m is not None:
        yield "others", DepthEstimate(range_m / range_over_depth(displayed.optics, shape))


def fitted(maps: list[Ahead], map_sigmas: tuple[float, ...]) -> CorridorPrior:
    """The constants of smallest cross entropy."""
    free = truly_free(maps)
    best: tuple[float, CorridorPrior] | None = None
    for map_sigma in map_sigmas:
        for scale in SCALES:
            ensembles = np.array([each.ensemble_m(scale, map_sigma) for each in maps])

            def prior_of(x: Floats, scale: float = scale, map_sigma: float = map_sigma):
                return CorridorPrior(x[0], scale, np.exp(x[1]), float(expit(x[2])), map_sigma)

            result = minimize(
                lambda x, e=ensembles, prior_of=prior_of: entropy(free, e, prior_of(x)),
                [0.0, -2.0, -3.0],
                method="Nelder-Mead",
                options={"maxfev": 80, "xatol": 0.02, "fatol": 2e-5},
            )
            if best is None or result.fun < best[0]:
                best = result.fun, prior_of(result.x)
    assert best is not None
    return CorridorPrior(**{n: float(f"{v:.3g}") for n, v in asdict(best[1]).items()})


def truly_free(maps: list[Ahead]) -> Floats:
    """1 where the corridor is free up to a distance, else 0 (maps, distances)."""
    true_m = np.array([each.true_m for each in maps])
    return (~(true_m[:, None] <= DISTANCES_M)).astype(np.float64)


def entropy(free: Floats, ensembles: Floats, prior: CorridorPrior) -> float:
    """Mean cross entropy of what is free and its probability."""
    far = DISTANCES_M >= FROM_M
    stated = free_of(ensembles, prior).clip(MIN, 1 - MIN)
    unlikely = free * np.log(stated) + (1 - free) * np.log(1 - stated)
    return float(-unlikely[:, far].mean())


def report(maps: list[Ahead], prior: CorridorPrior) -> dict[str, object]:
    """Families, number, entropy, and by tenths: mean probability, what is free, share."""
    far = DISTANCES_M >= FROM_M
    free = truly_free(maps)
    ensembles = np.array([each.ensemble_m(prior.scale, prior.map_sigma) for each in maps])
    stated = free_of(ensembles, prior)[:, far].ravel()
    truly, tenth = free[:, far].ravel(), np.minimum(stated * BINS, BINS - 1).astype(int)
    rows = [
        " ".join(f"{v:.3f}" for v in (stated[k].mean(), truly[k].mean(), k.mean()))
        for k in (tenth == n for n in range(BINS))
        if k.any()
    ]
    return {
        "families": sorted({each.family for each in maps}),
        "maps": len(maps),
        "entropy": round(entropy(free, ensembles, prior), 4),
        "reliability": rows,
    }


if __name__ == "__main__":
    main()
