"""Fit the prior of the depth map `anchored` to frames of drawn scenes.

    python tools/depth_frames.py LEARN
    python tools/depth_frames.py JUDGE --plan PLAN_OF_OTHER_FAMILIES
    python tools/anchored_prior.py LEARN JUDGE [--poses 3]

The constants of least mean |ln d / t| on LEARN, to which few frames whose spots are far off do not
matter most, by a simplex over their logarithms (J. A. Nelder, R. Mead, Comput. J. 7, 308 (1965)).
They are taken if they are better on JUDGE, too; else those stay that there are. Then, on LEARN, the
factor of the deviations of which twice holds 95 % of the pixels. Writes constants, and what they
rest on, into reconstruction/depth/anchored_prior.json.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from reconstruction.base.arrays import Floats
from reconstruction.capture import Optics
from reconstruction.depth import DepthEstimate, pixel_of
from reconstruction.depth.kriging import FITTED as FILE
from reconstruction.depth.kriging import AnchoredPrior, anchored_depth, fitted_prior

FREE = (
    *("log_depth_deviation", "log_reflectance_deviation", "correlation_length", "similarity"),
    *("nugget", "min_brightness", "max_nearer"),
)
STEP = 0.4
"""Of the logarithms, at first."""
EVALUATIONS = 200
COVERED = 0.954
"""Fraction of Gaussian errors within twice their sigma."""


@dataclass(frozen=True, eq=False)
class View:
    """What a map is made of, and what it should be."""

    scene: str
    family: str
    image: Floats
    anchors: Floats
    depth_m: Floats
    sigma_m: Floats
    true_m: Floats

    def mapped(self, prior: AnchoredPrior) -> DepthEstimate:
        """The map under a prior."""
        result = anchored_depth(self.image, self.anchors, self.depth_m, self.sigma_m, prior)
        assert result is not None
        return result


def main() -> None:
    """Fit, and write constants and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("learn", type=Path)
    parser.add_argument("judge", type=Path)
    parser.add_argument("--poses", type=int, default=3, help="of each scene, at most")
    asked = parser.parse_args()
    learn, judge = (of(folder, asked.poses) for folder in (asked.learn, asked.judge))
    before = replace(fitted_prior(), sigma_factor=1.0)
    fitted = simplex(before, learn)
    better = error(fitted, judge) < error(before, judge)
    prior = fitted if better else before
    prior = rounded(replace(prior, sigma_factor=sigma_factor(prior, learn)))
    manifest = {
        "prior": asdict(prior),
        "fitted": asdict(rounded(fitted)),
        "taken": better,
        "learn": reported(learn, before, fitted, prior),
        "judge": reported(judge, before, fitted, prior),
    }
    text = json.dumps(manifest, indent=2)
    FILE.write_text(text + "\n")
    print(text)


def of(folder: Path, poses: int) -> list[View]:
    """Frames of a folder."""
    return [view for file in sorted(folder.glob("*.npz")) for view in seen(file, poses)]


def simplex(start: AnchoredPrior, views: list[View]) -> AnchoredPrior:
    """The prior of smallest error."""
    result = minimize(
        lambda logs: error(changed(start, logs), views),
        np.zeros(len(FREE)),
        method="Nelder-Mead",
        options={
            "maxfev": EVALUATIONS,
            "xatol": 0.02,
            "fatol": 1e-5,
            "initial_simplex": STEP * np.eye(len(FREE) + 1, len(FREE)),
        },
    )
    return changed(start, result.x)


def rounded(prior: AnchoredPrior) -> AnchoredPrior:
    """Constants of three digits."""
    return AnchoredPrior(**{name: float(f"{value:.3g}") for name, value in asdict(prior).items()})


def reported(
    views: list[View], before: AnchoredPrior, fitted: AnchoredPrior, taken: AnchoredPrior
) -> dict[str, object]:
    """What the manifest says of a set of frames."""
    return {
        "families": sorted({view.family for view in views}),
        "frames": len(views),
        "error_before": round(error(before, views), 4),
        "error_fitted": round(error(fitted, views), 4),
        "within_2_sigma": round(float(np.mean(away(taken, views) <= 2)), 3),
    }


def seen(file: Path, poses: int) -> Iterator[View]:
    """Frames of a scene in which any spot has a range and anything is hit."""
    reported = np.load(file)
    for number in range(min(poses, len(reported["image"]))):
        image, true_m, directions = (
            reported[name][number].astype(np.float64) for name in ("image", "depth_m", "directions")
        )
        optics = Optics(*reported["slopes"][number].tolist())
        _, _, log_depth, log_sigma = reported["anchors"][number]  # of target and fog together
        finite = np.isfinite(log_depth) & np.isfinite(log_sigma)
        if finite.any() and np.isfinite(true_m).any() and np.percentile(image, 90) > 0:
            depth_m = np.exp(log_depth[finite])
            yield View(
                file.stem,
                str(reported["family"][number]),
                image,
                pixel_of(directions[finite], optics, image.shape),
                depth_m,
                log_sigma[finite] * depth_m,
                true_m,
            )


def changed(prior: AnchoredPrior, logs: Floats) -> AnchoredPrior:
    """A prior with its free constants multiplied by the exponentials of ``logs``."""
    factors = dict(zip(FREE, np.exp(logs), strict=True))
    changes = {name: float(getattr(prior, name) * factor) for name, factor in factors.items()}
    changes["max_nearer"] = max(changes["max_nearer"], 1.0)
    changes["min_brightness"] = min(changes["min_brightness"], 1.0)
    return replace(prior, **changes)


def error(prior: AnchoredPrior, views: list[View]) -> float:
    """Mean of |ln d / t| over pixels, and of that over frames."""
    return float(
        np.mean(
            [np.nanmean(np.abs(np.log(each.mapped(prior).depth_m / each.true_m))) for each in views]
        )
    )


def sigma_factor(prior: AnchoredPrior, views: list[View]) -> float:
    """Factor of the deviations."""
    return float(np.percentile(away(prior, views), 100 * COVERED) / 2)


def away(prior: AnchoredPrior, views: list[View]) -> Floats:
    """By how many deviations each pixel's ln depth is off."""
    off = []
    for view in views:
        result = view.mapped(prior)
        assert result.sigma is not None
        each = np.abs(np.log(result.depth_m / view.true_m)) / result.sigma
        off.append(each[np.isfinite(each)])
    return np.concatenate(off)


if __name__ == "__main__":
    main()
