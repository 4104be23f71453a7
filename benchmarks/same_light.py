"""Whether samples of a data set have the light that another program finds."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from alternatives import DualVolpath

from spisim.atmosphere import CLEAR
from spisim.dataset.planned import load_plan
from spisim.dataset.sample import load
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene, Volume
from spisim.simulation.light import solve
from spisim_paper.checks import Check, Table

#: Paths per pixel of `volpath`: its error is then about that of a sample.
DUAL_PATHS = 2048
_BANK_M = (200.0, 200.0, 200.0)
SMALL = """
vary:
  scene.fog: {kind: moderate-radiation, visibility_m: 50}
  instrument.projector.shape: [16, 16]
  instrument.plan.patterns: 32
"""


def same_light(plan: str, samples: int) -> tuple[Table, list[Check]]:
    """Images of small samples against Mitsuba's `volpath`, and their reported against true errors.

    Means: ‖mean difference of the images‖ over its standard error, all pixels of all samples, each
    image relative to the sum of its own light. The fog begins 1 m ahead: where it surrounds the
    instrument, `volpath` has no finite variance. Variances: the squared difference of two estimates
    of each image over what their errors promise, on average.
    """
    rest = plan[: plan.index("vary:")] + "transport_noise_share: 0.5"
    with TemporaryDirectory() as folder:
        path = Path(folder) / "plan.yaml"
        path.write_text(rest + SMALL)
        planned = load_plan(path)
    differences, sums, chi2 = [], [], []
    for index in range(samples):
        sample = planned.sample(index)
        scene, instrument = load(sample)
        placed = InstrumentView.placed(scene, instrument)
        scene = replace(scene, atmosphere=CLEAR, volumes=(_bank(scene, placed),))
        budget = planned.plan.sampling_budget
        first, second = (
            solve(scene, instrument, seed=seed, **budget) for seed in (2 * index, 2 * index + 1)
        )
        theirs = DualVolpath(scene, placed.projector, placed.bucket).image(DUAL_PATHS, index)
        ours = (first.image + second.image) / 2
        differences.append((ours - theirs) / theirs.sum())
        sums.append(ours.sum() / theirs.sum() - 1)
        promised = np.sum(first.image_error**2 + second.image_error**2)
        chi2.append(np.sum((first.image - second.image) ** 2) / promised)
    z = float(_z(np.array(differences).reshape(samples, -1)))
    z_sum = float(_z(np.array(sums)[:, None]))
    error = np.std(sums, ddof=1) / np.sqrt(samples)
    table = Table(
        f"Light of {samples} such samples of 16 × 16 pixels, whose fog begins 1 m ahead, against "
        "Mitsuba's `volpath`, and the squared difference of two estimates over what their errors "
        "promise:",
        ("mean over theirs", "z of the mean", "z of all pixels", "squared difference"),
        [
            (
                f"{100 * np.mean(sums):+.2f} % ± {100 * error:.2f} %",
                f"{z_sum:.1f}",
                f"{z:.1f}",
                f"{np.mean(chi2):.2f}",
            )
        ],
    )
    return table, [
        Check("z of the mean light", z_sum, 4),
        Check("z of all pixels", z, 4),
        Check("squared difference over promised", float(np.mean(chi2)), 1.5),
    ]


def _bank(scene: Scene, placed: InstrumentView) -> Volume:
    """The scene's fog from 1 m ahead of the instrument on."""
    box = np.diag([*_BANK_M, 1.0])
    box[:3, 3] = -_BANK_M[0] / 2, -_BANK_M[1] / 2, 1.0
    return Volume("bank", scene.atmosphere, placed.projector.pose @ box)


def _z(differences: np.ndarray) -> float:
    """‖mean‖ / ‖standard error‖ over (samples, numbers)."""
    errors = differences.var(axis=0, ddof=1) / len(differences)
    return float(np.linalg.norm(differences.mean(axis=0)) / np.sqrt(errors.sum()))
