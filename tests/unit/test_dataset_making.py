"""Data sets made by a function: what is made, kept, told and refused."""

from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

import spisim
from makers import OfPlan
from reconstruction import InputError
from runs import PLAN
from spisim.dataset import making
from spisim.dataset.planned import PlannedSet


@pytest.fixture
def bad(monkeypatch: pytest.MonkeyPatch) -> dict[int, str]:
    """What happens to samples, which are made without light."""
    trouble: dict[int, str] = {}

    def maker(planned: PlannedSet, folder: Path) -> OfPlan:
        return OfPlan(folder, trouble, planned=planned)

    monkeypatch.setattr(making, "Maker", maker)
    monkeypatch.setattr(making, "check_backend", lambda: None)
    return trouble


def test_a_plan_becomes_a_data_set_that_is_gone_on_with(
    bad: Mapping[int, str], tmp_path: Path
) -> None:
    plan, folder, fractions = tmp_path / "plan.yaml", tmp_path / "set", list[float]()
    plan.write_text(PLAN)
    data = spisim.make_dataset(plan, folder, workers=1, progress=fractions.append)
    assert [sample.index for sample in data] == [0, 1, 2, 3, 4]
    assert fractions == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1])
    assert data == spisim.open_dataset(folder)
    data[3].path.unlink()
    made = {path.name for path in (folder / "pids").iterdir()}
    fields = yaml.safe_load(PLAN)
    assert len(spisim.make_dataset(fields, folder, workers=1)) == 5
    again = {path.name for path in (folder / "pids").iterdir()} - made
    assert [name.partition("-")[0] for name in again] == ["3"]


def test_samples_that_fail_are_warned_of_and_tried_again_when_asked(
    bad: dict[int, str], tmp_path: Path
) -> None:
    fields = yaml.safe_load(PLAN)
    bad[2] = "fail"
    with pytest.warns(UserWarning, match="1 of 5 samples failed; sample 2: no luck"):
        data = spisim.make_dataset(fields, tmp_path / "set", workers=2)
    assert [record.index for record in data.failed] == [2]
    del bad[2]
    with pytest.warns(UserWarning, match="1 of 5 samples failed"):
        spisim.make_dataset(fields, tmp_path / "set", workers=1)
    assert len(spisim.make_dataset(fields, tmp_path / "set", workers=1, retry_failed=True)) == 5


def test_what_cannot_be_made_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    fields = yaml.safe_load(PLAN)
    with pytest.raises(InputError, match=r"plan: .*sampels.*did you mean 'samples'"):
        spisim.make_dataset({"sampels": 3, **fields}, tmp_path / "set")
    with pytest.raises(InputError, match="workers should be at least 1; found 0"):
        spisim.make_dataset(fields, tmp_path / "set", workers=0)
    with pytest.raises(InputError, match="no such file"):
        spisim.make_dataset(tmp_path / "none.yaml", tmp_path / "set")
    assert not list(tmp_path.iterdir())
