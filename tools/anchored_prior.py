"""Fit the prior of the depth method `anchored` to captures of drawn scenes.

    spisim dataset tools/anchored_prior.yaml -o out/anchored-prior
    python tools/anchored_prior.py out/anchored-prior

of families to learn from alone: the constants of least mean AbsRel, by simplex over their
logarithms (J. A. Nelder, R. Mead, Comput. J. 7, 308 (1965)); then the factor of the deviations of
which twice holds 95 % of the pixels. Writes them, and what they were fitted to, into
reconstruction/depth/anchored_prior.json.
"""

import argparse
import hashlib
import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import spisim.dataset
from drawn_images import FITTED as FAMILIES
from reconstruction import Reconstructor
from reconstruction.arrays import Floats
from reconstruction.depth import pixel_of
from reconstruction.depth.anchored_prior import FITTED as FILE
from reconstruction.depth.anchored_prior import AnchoredPrior, fitted_prior
from reconstruction.depth.methods.anchored import anchored_depth

RANGING = "fog"
FREE = (
    *("log_depth_deviation", "log_reflectance_deviation", "correlation_length", "similarity"),
    *("nugget", "min_brightness", "max_nearer"),
)
COVERED = 0.95


@dataclass(frozen=True)
class View:
    """What the map is made of, and what it should be."""

    image: Floats
    anchors: Floats
    depth_m: Floats
    sigma_m: Floats
    true_m: Floats


def main() -> None:
    """Fit, and write constants and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    asked = parser.parse_args()
    views = list(of(asked.folder))
    start = replace(fitted_prior(), doubt=1.0)
    found = minimize(
        lambda logs: error(changed(start, logs), views),
        np.zeros(len(FREE)),
        method="Nelder-Mead",
        options={"xatol": 0.02, "fatol": 1e-5, "maxfev": 600,
                 "initial_simplex": 0.4 * np.eye(len(FREE) + 1, len(FREE))},
    )  # fmt: skip
    prior = changed(start, found.x)
    prior = replace(prior, doubt=doubt(prior, views))
    told = {name: float(f"{value:.3g}") for name, value in asdict(prior).items()}
    manifest = {
        "prior": told,
        "families": list(FAMILIES),
        "plan": hashlib.sha256((asked.folder / "plan.yaml").read_bytes()).hexdigest(),
        "views": len(views),
        "abs_rel": [round(error(each, views), 4) for each in (start, AnchoredPrior(**told))],
    }
    text = json.dumps(manifest, indent=2)
    FILE.write_text(text + "\n")
    print(text)


def of(folder: Path) -> list[View]:
    """Views of a data set, but for those of families that are not to be learned from."""
    views = []
    for sample in spisim.dataset.open(folder):
        if sample.parameters["scene"] not in FAMILIES:
            continue
        capture = sample.capture
        setup = capture.setup
        assert setup.optics is not None
        assert setup.spots is not None
        assert capture.truth is not None
        result = Reconstructor(setup, ranging=RANGING, depth=())(capture.frame(0))
        assert result.ranges is not None
        anchors = pixel_of(setup.spots.directions, setup.optics, setup.plan.shape)
        depth_m, sigma_m = (each * setup.spots.directions[:, 2] for each in result.ranges.likeliest)
        true_m = capture.truth.at(0).depth_m.astype(np.float64)
        views.append(View(result.image.astype(np.float64), anchors, depth_m, sigma_m, true_m))
    return views


def changed(prior: AnchoredPrior, logs: Floats) -> AnchoredPrior:
    """A prior with its free constants multiplied by the exponentials of ``logs``."""
    factors = dict(zip(FREE, np.exp(logs), strict=True))
    changes = {name: float(getattr(prior, name) * factor) for name, factor in factors.items()}
    changes["max_nearer"] = max(changes["max_nearer"], 1.0)
    changes["min_brightness"] = min(changes["min_brightness"], 1.0)
    return replace(prior, **changes)


def error(prior: AnchoredPrior, views: list[View]) -> float:
    """Mean AbsRel."""
    return float(np.mean([_abs_rel(prior, view) for view in views]))


def _abs_rel(prior: AnchoredPrior, view: View) -> float:
    found = anchored_depth(view.image, view.anchors, view.depth_m, view.sigma_m, prior)
    assert found is not None
    return float(np.nanmean(np.abs(found.depth_m / view.true_m - 1)))


def doubt(prior: AnchoredPrior, views: list[View]) -> float:
    """Factor of the deviations."""
    away = []
    for view in views:
        found = anchored_depth(view.image, view.anchors, view.depth_m, view.sigma_m, prior)
        assert found is not None
        assert found.deviation is not None
        off = np.abs(np.log(found.depth_m / view.true_m)) / found.deviation
        away.append(off[np.isfinite(off)])
    return float(np.percentile(np.concatenate(away), 100 * COVERED) / 2)


if __name__ == "__main__":
    main()
