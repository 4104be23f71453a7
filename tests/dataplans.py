"""A plan of a data set with changes, and what is said about one."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from reconstruction.base.errors import InputError
from spisim.dataset.planned import PlannedSet, load_plan
from spisim.dataset.preview import check

PLAN = """
name: some
samples: 40
scenes:
  - {family: targets, parameters: {distance_m: {uniform: [2.0, 4.0]}}, weight: 3}
  - {scene: warehouse}
vary:
  scene.fog.visibility_m: {log_uniform: [20, 200]}
  scene.drone.offset_m: [{normal: [0, 0.1]}, 0, 0]
  instrument.lasers.power_w: {choice: [0.001, 0.005]}
materials:
  concrete: {choice: [cardboard, wood-dry]}
"""


def planned(folder: Path, text: str = PLAN, **changes: Any) -> PlannedSet:
    path = folder / "plan.yaml"
    path.write_text(yaml.safe_dump({**yaml.safe_load(text), **changes}, sort_keys=False))
    return load_plan(path)


def mistake(folder: Path, text: str = PLAN, **changes: Any) -> str:
    """What is said about a plan, whether it is read or checked."""
    with pytest.raises(InputError) as caught:
        check(planned(folder, text, **changes))
    assert str(caught.value).count(str(folder / "plan.yaml")) == 1
    return str(caught.value)
