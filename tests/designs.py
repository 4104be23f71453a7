"""Plans of designs, and a finished one, for tests."""

from pathlib import Path
from typing import Any

import numpy as np

from spisim.base.config import dump_yaml
from spisim_inverse.design.archive import Evaluation
from spisim_inverse.design.judgement import WITH_A_RANGE, Compared
from spisim_inverse.design.objectives import OBJECTIVES
from spisim_inverse.design.plan import PlannedDesign, load_design
from spisim_inverse.design.run import Design
from spisim_inverse.design.search import front

PLAN: dict[str, Any] = {
    "name": "test",
    "search": [{"scene": "target-plane"}],
    "judgement": [{"family": "warehouse", "count": 2}],
    "weathers": {"fog": {"fog": {"visibility_m": 50}}, "clear": {}},
    "choose": {
        "tof.times": {"low": [0.1, 0.1, 0.1], "high": [1, 1, 1]},
        "tof.modulation.light": {"values": ["sine", "square"]},
    },
    "objectives": ["range_error_m"],
}


def loaded(tmp_path: Path, **changes: Any) -> PlannedDesign:
    file = tmp_path / "plan.yaml"
    file.write_text(dump_yaml({**PLAN, **changes}))
    return load_design(file)


def finished(tmp_path: Path, **changes: Any) -> Design:
    """A design of two objectives as a search would leave it, without any light."""
    planned = loaded(
        tmp_path, objectives=["range_error_m", "image_nrmse"], **{"evaluations": 9, **changes}
    )
    rng = np.random.default_rng(0)
    evaluations = [
        Evaluation(
            {"tof.times": [0.2, 0.3, 1.0], "tof.modulation.light": "sine"} if number else {},
            {
                "range_error_m": float(error),
                "image_nrmse": float(0.4 - 20 * error + 0.02 * rng.random()),
            },
        )
        for number, error in enumerate(rng.uniform(2e-3, 5e-3, 9))
    ]
    best = front(evaluations, planned.plan.objectives)
    chosen, base = best[0], evaluations[0]
    judged = [
        Compared(weather, name, unit, 4.0, 3.0, sigma, 12)
        for weather in planned.plan.weathers
        for name, unit, sigma in (
            (OBJECTIVES["range_error_m"].title, "m", 0.05),
            (OBJECTIVES["image_nrmse"].title, "", 0.4),
            (WITH_A_RANGE, "%", 0.2),
        )
    ]
    unseen = [{name: 1.2 * value for name, value in (each.figures or {}).items()} for each in best]
    return Design(
        planned,
        base,
        chosen,
        evaluations,
        best,
        unseen,
        dict(base.figures or {}),
        judged,
        planned.instrument,
        {name: (None, value) for name, value in chosen.values.items()},
    )
