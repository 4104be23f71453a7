"""Samples that differ in the visibility alone: which they are, and how they share their light."""

import pickle
from pathlib import Path
from types import SimpleNamespace

import pytest

from reconstruction.base.errors import InputError
from spisim.dataset import fogs
from spisim.dataset.fogs import FogSeries, forget, light_of
from spisim.dataset.folder import TRACED_IN, Origin, origin_of
from spisim.dataset.planned import stated_plan
from spisim.dataset.records import COMPILING, SHARED, Outcome
from spisim.simulation.light.other_fog import Reweighted

FOGS = [
    {},
    {"scene.fog": {"kind": "haze-l", "visibility_m": 50}},
    {"scene.fog": {"kind": "haze-l", "visibility_m": 200}},
    {"scene.fog": {"kind": "chu-hogg", "visibility_m": 50}},
    {"scene.fog": {"kind": "haze-l", "visibility_m": 100}},
]


def plan(**changes):
    return {
        "name": "fogs",
        "scenes": [{"family": "targets"}],
        "vary": {
            "scene.parameters.distance_m": {"grid": [3, 5]},
            "scene.drone.offset_m": [{"uniform": [-0.1, 0.1]}, 0, 0],
            "weather": {"grid": FOGS},
        },
        **changes,
    }


def series(index, **changes):
    return FogSeries(stated_plan(plan(**changes))).of(index)


def test_a_series_has_the_droplets_the_scene_and_the_pose_of_a_sample():
    assert [series(index) for index in range(5)] == [(0,), (1, 2, 4), (1, 2, 4), (3,), (1, 2, 4)]
    assert series(6) == (6, 7, 9)  # the wall farther away
    assert series(14) == (11, 12, 14)  # the next round


def test_a_series_does_not_depend_on_the_number_of_samples():
    assert series(1, samples=2) == (1, 2, 4)


@pytest.mark.parametrize(
    "changes",
    [
        {"spp": 16},
        {"light": "surrogate"},
        {"frames": "flight", "poses": {"flight_s": 1.0}},
        {"vary": {"scene.fog": {"kind": "haze-l", "visibility_m": 50}}, "samples": 4},
        {"vary": {"scene.fog.visibility_m": {"uniform": [20, 50]}}, "samples": 4},
    ],
)
def test_plans_without_a_series(changes):
    assert series(1, **changes) == (1,)


def test_a_grid_of_visibilities_is_a_series():
    vary = {"scene.fog.kind": "haze-l", "scene.fog.visibility_m": {"grid": [50, 100]}}
    assert series(3, vary=vary) == (2, 3)


def test_what_is_drawn_anew_is_no_series():
    vary = {"instrument.plan.patterns": {"grid": [63, 127]}, "weather": {"grid": FOGS[:3]}}
    assert series(5, vary=vary) == (4, 5)


def test_a_sample_that_cannot_be_described_is_alone():
    bad = {"scene.fog": {"kind": "haze-l", "visibility_m": 20}, "scene.name.x": 1}
    vary = {"scene.name": "named", "weather": {"grid": [*FOGS[:3], bad]}}
    assert [series(index, vary=vary) for index in (1, 2, 3)] == [(1, 2), (1, 2), (3,)]


def test_workers_stay_in_a_series_and_else_in_a_round():
    worlds = [FogSeries(stated_plan(plan())).world_of(index) for index in range(11)]
    assert worlds == [0, 1, 1, 0, 1, 0, 6, 6, 0, 6, 10]


def test_series_can_be_sent_to_a_worker():
    one = FogSeries(stated_plan(plan()))
    assert one.of(2) == pickle.loads(pickle.dumps(one)).of(2)


@pytest.fixture
def traced(monkeypatch):
    """Light of series, without tracing."""
    calls = []

    def trace_fogs(scenes, instrument, *, seeds, transport_noise_share):
        calls.append([scene.atmosphere.visibility_m for scene in scenes])
        fogs.warnings.warn("dropped", stacklevel=1)
        first, *rest = scenes
        ratios = [
            each.atmosphere.extinction_per_m / first.atmosphere.extinction_per_m for each in rest
        ]
        return [
            SimpleNamespace(reweighted=None),
            *(SimpleNamespace(reweighted=Reweighted(ratio, 0.9)) for ratio in ratios),
        ]

    monkeypatch.setattr(fogs, "trace_fogs", trace_fogs)
    forget()
    yield calls
    forget()


def fog_scene(sample, **changes):
    from spisim.dataset.sample import load

    scene, instrument = load(sample)
    return scene, changes.get("instrument", instrument)


def test_the_light_of_a_series_is_traced_once(traced):
    planned = stated_plan(plan())
    first = light_of(planned, (1, 2, 4), fog_scene)
    again = light_of(planned, (1, 2, 4), fog_scene)
    assert traced == [[50, 200, 100]]
    assert (first.is_new, again.is_new) == (True, False)
    assert set(again.light) == {1, 2, 4}
    assert again.visibility_m == {1: 50, 2: pytest.approx(50), 4: pytest.approx(50)}
    assert [str(each.message) for each in again.warnings] == ["dropped"]
    light_of(planned, (6, 7, 9), fog_scene)
    light_of(planned, (1, 2, 4), fog_scene)
    assert len(traced) == 3


def test_scenes_that_cannot_be_loaded_are_left_out(traced):
    def load(sample):
        if sample.index == 2:
            raise InputError("no")
        return fog_scene(sample)

    assert set(light_of(stated_plan(plan()), (1, 2, 4), load).light) == {1, 4}


def test_steered_spots_other_weather_and_what_cannot_be_traced_have_no_shared_light(
    traced, monkeypatch
):
    steered = SimpleNamespace(lasers=SimpleNamespace(steering=object()))
    planned = stated_plan(plan())
    assert not light_of(planned, (1, 2), lambda s: fog_scene(s, instrument=steered)).light
    rainy = plan(vary={"scene.rain": {"rate_mm_per_h": 5, "model": "drops"}, **plan()["vary"]})
    assert not light_of(stated_plan(rainy), (1, 2), fog_scene).light
    assert traced == []

    def fails(*arguments, **options):
        raise InputError("too bright")

    monkeypatch.setattr(fogs, "trace_fogs", fails)
    assert not light_of(planned, (1, 2, 4), fog_scene).light


def test_the_origin_keeps_the_fog_that_was_traced(tmp_path: Path):
    origin = Origin("abc", 4, {}, (), 50.0)
    assert origin.settings[TRACED_IN] == 50.0
    settings = f"data_set: {{plan: abc, index: 4, {TRACED_IN}: 50.0}}"
    capture = SimpleNamespace(provenance=SimpleNamespace(settings=settings))
    assert origin_of(capture) == origin
    assert TRACED_IN not in Origin("abc", 4, {}).settings


def test_the_cost_of_a_sample_is_without_the_light_of_others():
    outcome = Outcome(0, "done", seconds=10.0, stage_seconds={COMPILING: 2.0, SHARED: 5.0})
    assert outcome.own_s == 3.0
