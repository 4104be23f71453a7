"""Depth maps of shipped scenes in fog: by plain ranges, by those fitted with the fog, by true ones.

    python benchmarks/fog_depth.py [--quick] [--json] [--markdown]

Preset `fog`, radiation fog in place of the scenes' own weather. What is promised is that the depth
map from fitted ranges is nearly as good as that from true ones. `--markdown` pastes the table into
docs/results/ranging.md.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from options import benchmark_options, finish

import spisim
from reconstruction import Capture, Reconstructor, evaluate
from reconstruction.depth import DEPTH_METHODS
from reconstruction.depth.method import Context, View
from reconstruction.image import Imaging
from spisim.instrument import Instrument
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "ranging.md"
SCENES = ("warehouse", "rubble", "scaffold", "tunnel", "person", "hovering-drone", "landing-pad",
          "street-canyon", "stairwell", "forest-trail", "power-line", "racing-gates",
          "reflective-shelf")  # fmt: skip
VISIBILITIES_M = (50, 100)
PACKAGES = ("spisim", "mitsuba", "drjit", "numpy")
WAYS = ("cw", "fog", "true ranges")
EXACT_M = 1e-3
MAX = 1.1


def main() -> int:
    """Mean absolute error of depth by scene, visibility and way of ranging."""
    options = benchmark_options(__doc__, "four scenes", PAGE)
    scenes = SCENES[:4] if options.quick else SCENES
    instrument = spisim.load_instrument("fog")
    rows: list[tuple[str, ...]] = []
    checks: list[Check] = []
    for visibility_m in VISIBILITIES_M:
        errors = np.array([errors_m(name, visibility_m, instrument) for name in scenes])
        rows += [
            (name, str(visibility_m), *(f"{error:.2f}" for error in row))
            for name, row in zip(scenes, errors, strict=True)
        ]
        means = errors.mean(axis=0)
        rows.append(("mean", str(visibility_m), *(f"{mean:.2f}" for mean in means)))
        name = f"depth error at {visibility_m} m, fitted over true ranges"
        checks.append(Check(name, float(means[1] / means[2]), MAX))
    table = Table(
        "Mean error of the depth map, m, by ranges", ("scene", "visibility / m", *WAYS), rows
    )
    return finish(options, PAGE, "depth", surroundings(PACKAGES), [table], checks)


def errors_m(name: str, visibility_m: float, instrument: Instrument) -> list[float]:
    """Mean absolute errors of the anchored depth map by plain, fitted and true ranges."""
    weather = {"fog": {"visibility_m": visibility_m, "kind": "moderate-radiation"}}
    scene = spisim.load_scene(name, weather | {"rain": None, "snow": None})
    capture = spisim.simulate(scene, instrument, transport_noise_share=0.3, seed=0).capture
    outcome = []
    for method in WAYS[:2]:
        result = Reconstructor(capture.setup, ranging=method, depth="anchored")(capture.frame(0))
        outcome.append(float(evaluate(result, capture)["depths"]["anchored"]["mae_m"]))
    return [*outcome, by_true_ranges_m(capture)]


def by_true_ranges_m(capture: Capture) -> float:
    """The same of the map from the spots' true ranges."""
    result = Reconstructor(capture.setup, ranging="fog", depth="anchored")(capture.frame(0))
    truth = capture.truth.at(0) if capture.truth is not None else None
    assert truth is not None
    assert result.ranges is not None
    true = replace(
        result.ranges,
        range_m=truth.spot_range_m,
        sigma_m=np.full(4, EXACT_M),
        status=("ok",) * 4,
        alternatives=((),) * 4,
    )
    solver = DEPTH_METHODS["anchored"].compile(Context(capture.setup, Imaging(capture.plan)))
    outcome = solver(View(result.image.astype(np.float64), true, capture.frame(0)))
    assert outcome is not None
    exact = replace(result, depths={"anchored": np.asarray(outcome.depth_m, np.float32)})
    return float(evaluate(exact, capture)["depths"]["anchored"]["mae_m"])


if __name__ == "__main__":
    sys.exit(main())
