"""Learn depth maps from bucket readings and four ranges, and try them on scenes never seen.

    pip install 'spisim[examples]'
    python examples/estimator.py -o out/estimator

Makes the data set of estimator.yaml (run again, it only goes on), then fits principal components
of the readings and of the depth map `anchored`, and a kernel ridge regression on them
and the ranges, and compares. Takes about 4 minutes on two cores.
"""

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sklearn.decomposition import PCA
from sklearn.kernel_ridge import KernelRidge
from sklearn.model_selection import GridSearchCV

import spisim.dataset
from reconstruction import reconstruct
from reconstruction.base.arrays import Floats
from reconstruction.evaluation import depth_metrics
from spisim.dataset import DataSet

PLAN = Path(__file__).with_suffix(".yaml")
COMPONENTS = 40
RANGES_WEIGHT = 0.3  # of each against the components, which have a variance of 1 in all
FALLBACK_M = 5.0  # where no spot has a range

Errors = dict[str, float | None]


@dataclass(frozen=True)
class Readings:
    """What an instrument has of N views, frame 0, and depth maps made of it.

    Light (N, M), ranges (N, 4), the anchored depth map and that of the nearest spot (N, H, W); nan
    where there is none.
    """

    buckets: Floats
    range_m: Floats
    depth_m: Floats
    depth_nearest_m: Floats

    @property
    def level(self) -> Floats:
        """Mean light of each view, (N, 1)."""
        return self.buckets.mean(axis=1, keepdims=True)

    @property
    def filled_range_m(self) -> Floats:
        """Ranges in which the median of a view's others stands for one that is missing."""
        finite = np.isfinite(self.range_m)
        others = np.ma.median(np.ma.masked_array(self.range_m, ~finite), axis=1).filled(FALLBACK_M)
        return np.where(finite, self.range_m, others[:, None])

    @property
    def distance_m(self) -> Floats:
        """Geometric mean of the ranges, (N, 1): all depths are learned relative to it."""
        return np.exp(np.log(self.filled_range_m).mean(axis=1, keepdims=True))


class Components:
    """Principal components of some data, with a variance of 1 in all."""

    def __init__(self, data: Floats) -> None:
        self.components = PCA(COMPONENTS).fit(data)
        self.spread = np.sqrt(self.components.explained_variance_.sum())

    def __call__(self, data: Floats) -> Floats:
        return np.asarray(self.components.transform(data) / self.spread)


class Estimator:
    """Depth maps by kernel ridge regression; its two constants are those of cross-validation."""

    def __init__(self) -> None:
        constants = {"gamma": [0.03, 0.1, 0.3], "alpha": [0.03, 0.1, 0.3, 1.0]}
        self.regression = GridSearchCV(KernelRidge(kernel="rbf"), constants)

    def fit(self, readings: Readings, depth_m: Floats) -> None:
        """Learn from true depth maps (N, H, W); nan, where nothing is hit, counts as far away."""
        self.shape = depth_m.shape[1:]
        self.patterns = Components(_patterns(readings))
        self.maps = Components(_map(readings))
        ranges = _ranges(readings)
        self.mean, self.sigma = ranges.mean(axis=0), ranges.std(axis=0)
        depth_m = np.nan_to_num(depth_m, nan=np.nanmax(depth_m))
        relative = np.log(depth_m.reshape(len(depth_m), -1) / readings.distance_m)
        self.usual = relative.mean(axis=0)
        self.regression.fit(self._features(readings), relative - self.usual)

    def predict(self, readings: Readings) -> Floats:
        """Depth maps (N, H, W) in metres."""
        relative = self.usual + self.regression.predict(self._features(readings))
        return np.asarray((np.exp(relative) * readings.distance_m).reshape(-1, *self.shape))

    def _features(self, readings: Readings) -> Floats:
        light, maps = self.patterns(_patterns(readings)), self.maps(_map(readings))
        ranges = (_ranges(readings) - self.mean) / self.sigma
        return np.hstack([light, maps, RANGES_WEIGHT * ranges])


def _patterns(readings: Readings) -> Floats:
    """Readings relative to their mean: what is seen, not how bright it is."""
    return readings.buckets / readings.level


def _map(readings: Readings) -> Floats:
    """Depths by `reconstruct` relative to the ranges' mean, (N, H * W)."""
    depth_m = readings.depth_m.reshape(len(readings.depth_m), -1)
    return np.asarray(np.log(np.nan_to_num(depth_m, nan=FALLBACK_M) / readings.distance_m))


def _ranges(readings: Readings) -> Floats:
    """Ranges relative to their mean, that mean, and how much light comes back from there."""
    distance_m = readings.distance_m
    relative = np.log(readings.filled_range_m / distance_m)
    return np.hstack([relative, np.log(distance_m), np.log(readings.level * distance_m**2)])


def load(samples: DataSet) -> tuple[Readings, Floats]:
    """Readings and true depth maps."""
    arrays = samples.arrays("buckets", "spot_range_m", "true_depth_m")
    true_m = arrays["true_depth_m"][:, 0]
    methods = ("anchored", "nearest")
    results = [reconstruct(sample.capture, depth=methods) for sample in samples]
    depth_m = _stacked([result.depths.get("anchored") for result in results], true_m)
    nearest_m = _stacked([result.depths.get("nearest") for result in results], true_m)
    return Readings(
        arrays["buckets"][:, 0], arrays["spot_range_m"][:, 0], depth_m, nearest_m
    ), true_m


def _stacked(maps_m: list[NDArray[np.float32] | None], like: Floats) -> Floats:
    """One array of depth maps; nan where there is none."""
    missing = np.full(like.shape[1:], np.nan)
    return np.array([missing if depth_m is None else depth_m for depth_m in maps_m])


def compare(samples: DataSet) -> dict[str, dict[str, Errors]]:
    """Errors on scenes that were not learned from: by group of samples, then by method.

    The groups are all of them, and those of each family.
    """
    learned, _, unseen = samples.split(0.75, 0, 0.25)
    estimator = Estimator()
    estimator.fit(*load(learned))
    readings, true_m = load(unseen)
    maps = {
        "learned": estimator.predict(readings),
        "anchored": readings.depth_m,
        "nearest spot": readings.depth_nearest_m,
    }
    families = np.array([sample.parameters["scene"] for sample in unseen])
    groups = {f"all, from {len(learned)} others": np.full(len(unseen), True)}
    groups |= {family: families == family for family in sorted(set(families))}
    return {
        f"{group} ({members.sum()})": {
            name: depth_metrics(depth_m[members], true_m[members]) for name, depth_m in maps.items()
        }
        for group, members in groups.items()
    }


def main() -> None:
    """Make the data set where it is missing, learn, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/estimator"))
    parser.add_argument("--workers", default="2")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    spisim_command = Path(sys.executable).with_name("spisim")
    run = [spisim_command, "dataset", PLAN, "-o", options.output, "--workers", options.workers]
    if subprocess.run(run, check=False).returncode > 1:  # 1: some samples failed
        sys.exit(2)
    errors = compare(spisim.dataset.open(options.output))
    if options.json:
        print(json.dumps(errors))
        return
    for group, methods in errors.items():
        print(f"{group:28}{'mean error':>12}{'RMS error':>12}{'median':>10}{'within 25 %':>13}")
        for name, error in methods.items():
            print(
                f"  {name:26}{error['mae_m']:10.2f} m{error['rmse_m']:10.2f} m"
                f"{error['median_relative']:10.1%}{error['within_25_percent']:13.0%}"
            )


if __name__ == "__main__":
    main()
