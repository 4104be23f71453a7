"""Fit the prior of the depth method `anchored` to frames of drawn scenes.

    python tools/depth_frames.py FOLDER
    python tools/anchored_prior.py FOLDER [--poses 3]

of the families to learn from: the constants of least mean AbsRel, by a simplex over their
logarithms (J. A. Nelder, R. Mead, Comput. J. 7, 308 (1965)); then the factor of the deviations of
which twice holds 95 % of the pixels. Writes them, and what they were fitted to, into
reconstruction/depth/anchored_prior.json.
"""

import argparse
import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from reconstruction.arrays import Floats
from reconstruction.capture import Optics
from reconstruction.depth import DepthEstimate, pixel_of
from reconstruction.depth.anchored_prior import FITTED as FILE
from reconstruction.depth.anchored_prior import AnchoredPrior, fitted_prior
from reconstruction.depth.methods.anchored import anchored_depth

FREE = (
    *("log_depth_deviation", "log_reflectance_deviation", "correlation_length", "similarity"),
    *("nugget", "min_brightness", "max_nearer"),
)
STEP = 0.4
"""Of the logarithms, at first."""
EVALUATIONS = 400
COVERED = 0.954
"""Share of Gaussian errors within twice their deviation."""


@dataclass(frozen=True, eq=False)
class Sight:
    """What a map is made of, and what it should be."""

    family: str
    image: Floats
    anchors: Floats
    depth_m: Floats
    sigma_m: Floats
    true_m: Floats

    def mapped(self, prior: AnchoredPrior) -> DepthEstimate:
        """The map under a prior."""
        found = anchored_depth(self.image, self.anchors, self.depth_m, self.sigma_m, prior)
        assert found is not None
        return found


def main() -> None:
    """Fit, and write constants and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--poses", type=int, default=3, help="of each scene, at most")
    asked = parser.parse_args()
    files = sorted(asked.folder.glob("*.npz"))
    sights = [sight for file in files for sight in seen(file, asked.poses)]
    start = replace(fitted_prior(), doubt=1.0)
    found = minimize(
        lambda logs: abs_rel(changed(start, logs), sights),
        np.zeros(len(FREE)),
        method="Nelder-Mead",
        options={
            "maxfev": EVALUATIONS,
            "xatol": 0.02,
            "fatol": 1e-5,
            "initial_simplex": STEP * np.eye(len(FREE) + 1, len(FREE)),
        },
    )
    prior = changed(start, found.x)
    prior = replace(prior, doubt=doubt(prior, sights))
    told = {name: float(f"{value:.3g}") for name, value in asdict(prior).items()}
    manifest = {
        "prior": told,
        "abs_rel": {
            "before": round(abs_rel(start, sights), 4),
            "after": round(abs_rel(prior, sights), 4),
        },
        "families": sorted({sight.family for sight in sights}),
        "frames": len(sights),
        "content": hashlib.sha256(b"".join(each.read_bytes() for each in files)).hexdigest(),
    }
    text = json.dumps(manifest, indent=2)
    FILE.write_text(text + "\n")
    print(text)


def seen(file: Path, poses: int) -> Iterator[Sight]:
    """Frames of a scene in which any spot has a range and anything is hit."""
    told = np.load(file)
    for number in range(min(poses, len(told["image"]))):
        image, true_m, directions = (
            told[name][number].astype(np.float64) for name in ("image", "depth_m", "directions")
        )
        optics = Optics(*told["slopes"][number].tolist())
        _, _, log_depth, log_sigma = told["anchors"][number]  # of target and fog together
        known = np.isfinite(log_depth) & np.isfinite(log_sigma)
        if known.any() and np.isfinite(true_m).any() and np.percentile(image, 90) > 0:
            depth_m = np.exp(log_depth[known])
            yield Sight(
                str(told["family"][number]),
                image,
                pixel_of(directions[known], optics, image.shape),
                depth_m,
                log_sigma[known] * depth_m,
                true_m,
            )


def changed(prior: AnchoredPrior, logs: Floats) -> AnchoredPrior:
    """A prior with its free constants multiplied by the exponentials of ``logs``."""
    factors = dict(zip(FREE, np.exp(logs), strict=True))
    changes = {name: float(getattr(prior, name) * factor) for name, factor in factors.items()}
    changes["max_nearer"] = max(changes["max_nearer"], 1.0)
    changes["min_brightness"] = min(changes["min_brightness"], 1.0)
    return replace(prior, **changes)


def abs_rel(prior: AnchoredPrior, sights: list[Sight]) -> float:
    """Mean of |d - t| / t over pixels, and of that over frames."""
    return float(
        np.mean(
            [np.nanmean(np.abs(sight.mapped(prior).depth_m / sight.true_m - 1)) for sight in sights]
        )
    )


def doubt(prior: AnchoredPrior, sights: list[Sight]) -> float:
    """Factor of the deviations."""
    off = []
    for sight in sights:
        found = sight.mapped(prior)
        assert found.deviation is not None
        away = np.abs(np.log(found.depth_m / sight.true_m)) / found.deviation
        off.append(away[np.isfinite(away)])
    return float(np.percentile(np.concatenate(off), 100 * COVERED) / 2)


if __name__ == "__main__":
    main()
