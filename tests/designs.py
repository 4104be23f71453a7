"""A plan of a design, for tests."""

from pathlib import Path
from typing import Any

from spisim.base.config import dump_yaml
from spisim_inverse.design.plan import PlannedDesign, load_design

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
