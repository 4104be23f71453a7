"""What a plan would cost: groups of samples, and a pilot of a few that are made."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from makers import Fake, InThisProcess
from reconstruction.base.errors import InputError
from runs import Run, rows, write_plan
from spisim.dataset import cost as costs
from spisim.dataset import sample as samples
from spisim.dataset.cost import Cost, Group, Pilot
from spisim.dataset.planned import PlannedSet
from spisim.dataset.preview import preview
from spisim.dataset.records import COMPILING, Outcome, Record
from spisim.dataset.runner import run_dataset
from spisim.dataset.sample import Maker, WarmMaker

PLAN = """
name: mixed
samples: 300
scenes: [{family: targets, weight: 3}, {scene: warehouse}]
vary:
  weather:
    grid:
      - {scene.fog: null}
      - {scene.fog.visibility_m: 40}
      - {scene.rain.rate_mm_per_h: 5, scene.fog.kind: haze-m, scene.fog.visibility_m: 300}
"""
WEATHERS = {"clear", "fog", "fog, rain"}


@pytest.fixture
def planned(tmp_path: Path) -> PlannedSet:
    return write_plan(tmp_path, PLAN)


def record(index: int, seconds: float, **more: object) -> Record:
    return Record(index, "done", seconds=seconds, bytes=1000, **more)  # type: ignore[arg-type]


def test_a_pilot_has_every_scene_in_every_weather(planned: PlannedSet) -> None:
    pilot = Pilot.of(planned, 12)
    groups = [pilot.groups[index] for index in pilot.indices]
    every = {Group(scene, weather) for scene in ("targets", "warehouse") for weather in WEATHERS}
    assert set(groups[:6]) == set(groups) == set(pilot.groups.values()) == every
    assert len(set(pilot.indices)) == 12
    assert [groups[k].scene for k in range(3)] == ["targets"] * 3  # the frequent ones first
    assert Pilot.of(planned, 2).indices == pilot.indices[:2]
    assert len(Pilot.of(planned.with_samples(5), 12).indices) == 5
    for index in pilot.indices[:3]:
        weather = planned.sample(index).parameters
        assert (weather.get("scene.fog.visibility_m") is not None) == (
            pilot.groups[index].weather != "clear"
        )


def test_a_sample_counts_for_all_of_its_group(planned: PlannedSet) -> None:
    """A group of three quarters with one sample weighs three times one of a quarter with four."""
    common, rare = Group("targets", "fog"), Group("warehouse", "clear")
    pilot = Pilot([0, 4, 5, 6, 7], {0: common, 1: common, 2: common, 3: common, 4: rare})
    pilot.groups.update({5: rare, 8: common, 9: common, 10: common, 11: common})
    pilot.groups.update(dict.fromkeys((12, 13, 14, 15), common) | {6: rare, 7: rare})
    made = [record(0, 8.0), *(record(index, seconds=index - 3.0) for index in (4, 5, 6, 7))]
    costs, cost = pilot.costs(made)
    assert [(each.group, each.fraction) for each in costs] == [(common, 0.75), (rare, 0.25)]
    assert costs[1].cost == Cost(4, 2.0, 4.0, 4.0, 2.5)
    assert cost == Cost(5, 8.0, 8.0, 8.0, pytest.approx(0.75 * 8 + 0.25 * 2.5))
    assert costs[0].summary()["cost"]["samples"] == 1
    others, only = pilot.costs([made[0], record(99, 1000.0)])
    assert only.mean_s == 8
    assert others[1].cost is None
    assert others[1].summary()["cost"] is None
    with pytest.raises(ValueError, match="no finished samples"):
        pilot.costs([])


def test_compiling_is_no_cost_of_a_sample() -> None:
    pilot = Pilot([0], {0: Group("targets", "clear")})
    _, cost = pilot.costs([record(0, 56.0, stage_seconds={COMPILING: 51.0})])
    assert cost.median_s == 5


def test_the_mean_is_that_of_the_plan(planned: PlannedSet, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pilots of many seeds: their mean is that of all samples, whatever the groups cost."""

    def cost_s(group: Group) -> float:
        return len(group.weather) * (10.0 if group.scene == "warehouse" else 1.0)

    monkeypatch.setattr(costs, "MAX_DRAWN", 60)
    means, truths = [], []
    for seed in range(12):
        plan = planned.plan.model_copy(update={"seed": seed})
        pilot = Pilot.of(replace(planned, plan=plan), 8)
        _, cost = pilot.costs(record(index, cost_s(pilot.groups[index])) for index in pilot.indices)
        means.append(cost.mean_s)
        truths.append(np.mean([cost_s(group) for group in pilot.groups.values()]))
    np.testing.assert_allclose(means, truths)  # all samples of a group cost the same here


def test_only_some_samples_are_made(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    some = Run(planned.with_samples(9), folder, only=[7, 2])
    assert some.executor.asked == [[2, 7]]
    assert (some.state.samples, some.state.done, some.state.missing) == (2, 2, 0)
    assert Run(planned.with_samples(9), folder, only=[2, 3]).state.samples == 3
    assert Run(planned.with_samples(9), folder).executor.asked == [[0, 1, 4, 5, 6, 8]]


class Timed(Fake):
    def __call__(self, index: int) -> Outcome:
        return replace(super().__call__(index), seconds=1.0 + index)


def test_a_run_goes_on_from_its_pilot(planned: PlannedSet, tmp_path: Path) -> None:
    folder, planned = tmp_path / "set", planned.with_samples(20)
    executor = InThisProcess(Timed(folder))
    result = preview(planned, folder, lambda make: executor, 2, pilot=6)
    chosen = sorted(Pilot.of(planned, 6).indices)
    assert executor.asked == [chosen]
    assert result.cost.max_s == 1 + chosen[-1]
    assert result.bytes_per_sample == pytest.approx(8.5, abs=0.5)  # of "sample 7"
    assert result.seconds == pytest.approx(20 * result.cost.mean_s / 2)
    assert preview(planned, folder, lambda make: executor, 2, pilot=6) == result
    assert len(executor.asked) == 1  # they are there
    run_dataset(planned, folder, executor)
    assert sorted(chosen + executor.asked[1]) == list(range(20))
    assert len(rows(folder, "seconds")) == 20


def test_failures_of_a_pilot(planned: PlannedSet, tmp_path: Path) -> None:
    planned = planned.with_samples(4)
    indices = Pilot.of(planned, 2).indices
    some = InThisProcess(Timed(tmp_path / "some", {indices[0]: "fail"}))
    result = preview(planned, tmp_path / "some", lambda make: some, 2, pilot=2)
    assert result.failures == {indices[0]: "no luck"}
    assert result.cost.samples == 1
    none = InThisProcess(Timed(tmp_path / "none", dict.fromkeys(range(4), "fail")))
    with pytest.raises(InputError, match=r"all 2 pilot samples failed; sample \d: no luck"):
        preview(planned, tmp_path / "none", lambda make: none, 2, pilot=2)


def test_the_first_sample_of_a_process_warms_it_up(
    planned: PlannedSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = iter([60.0, 2.0, 3.0])
    compiling = iter([50.0, 0.0, 1.0])

    def made(maker: Maker, index: int) -> Outcome:
        return Outcome(
            index, "done", seconds=next(seconds), stage_seconds={COMPILING: next(compiling)}
        )

    monkeypatch.setattr(Maker, "__call__", made)
    monkeypatch.setattr(samples, "_warm", [])
    make = WarmMaker(planned, Path())
    first, second = make(4), make(5)
    assert (first.seconds, first.compiling_s) == (52.0, 50.0)
    assert (second.seconds, second.compiling_s) == (3.0, 1.0)
