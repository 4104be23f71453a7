"""A small study, shared by the tests."""

from pathlib import Path
from typing import Any

import yaml

from spisim.dataset.study import load_study
from spisim.dataset.study.plan import PlannedStudy

PLAN: dict[str, Any] = {
    "name": "Walls <in> fog",
    "scenes": [{"scene": "target-plane"}],
    "vary": {"scene.fog.visibility_m": {"grid": [20, 100]}},
    "spp": 8,
    "study": {"x": "scene.fog.visibility_m", "rounds": 2, "metrics": ["range_bias_m"]},
}


def planned(folder: Path, study: dict[str, Any] | None = None, **changes: Any) -> PlannedStudy:
    fields = {**PLAN, **changes, "study": {**PLAN["study"], **(study or {})}}
    (folder / "plan.yaml").write_text(yaml.safe_dump(fields, sort_keys=False))
    return load_study(folder / "plan.yaml")
