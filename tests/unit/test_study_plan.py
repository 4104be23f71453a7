"""Plans of studies: what is compared, and what cannot be."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from reconstruction import InputError
from spisim.dataset.sample import load
from spisim.dataset.study import load_study
from studies import PLAN, planned

STUDIES = Path(__file__).parents[2] / "studies"


def test_rounds_run_through_all_combinations(tmp_path: Path) -> None:
    study = planned(tmp_path, study={"rounds": 3})
    assert study.data_set.plan.size == 6
    assert study.conditions == [(20,), (100,)]


def test_what_is_compared_may_change_without_new_samples(tmp_path: Path) -> None:
    one = planned(tmp_path)
    other = planned(tmp_path, study={"metrics": ["valid_spots"], "rounds": 5})
    assert one.data_set.digest == other.data_set.digest
    assert "study" not in one.data_set.fields


def test_fields_that_change_together_and_instruments_are_grids(tmp_path: Path) -> None:
    study = planned(
        tmp_path,
        study={"x": "scene.fog.visibility_m", "groups": ["instrument", "scene.rain.rate_mm_per_h"]},
        instrument={"grid": ["paper", "fga015"]},
        vary={
            "scene.fog": None,
            "weather": {
                "grid": [
                    {},
                    {"scene.fog": {"visibility_m": 50, "kind": "haze-l"}},
                    {"scene.rain": {"rate_mm_per_h": 4}},
                ]
            },
        },
    )
    samples = [study.data_set.sample(index) for index in range(6)]
    assert study.conditions == [
        (visibility, instrument, rain)
        for instrument in ("paper", "fga015")
        for visibility, rain in ((None, None), (50, None), (None, 4))
    ]
    scenes = [sample.scene_fields for sample in samples]
    assert ["fog" in scene for scene in scenes] == [False, True, False] * 2
    assert [scene.get("rain") for scene in scenes[:3]] == [None, None, {"rate_mm_per_h": 4}]
    areas = [
        sample.instrument_fields["detector"]["sensor"]["photoactive_area_mm2"] for sample in samples
    ]
    assert areas[0] == areas[1] == areas[2] != areas[3] == areas[4] == areas[5]


@pytest.mark.parametrize("name", ["fog-and-rain", "depth"])
def test_the_studies_that_are_shipped_can_be_run(name: str) -> None:
    study = load_study(STUDIES / f"{name}.yaml")
    small = study.quick()
    assert study.study.rounds >= 5
    assert small.data_set.plan.size < study.data_set.plan.size / 3
    assert study.conditions[0][1:] == (None,) * len(study.study.groups)  # clear air is first
    assert len(set(study.conditions)) == len(study.conditions)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::spisim.scene.SceneWarning")  # fog is denser than natural
@pytest.mark.parametrize("name", ["fog-and-rain", "depth"])
def test_every_view_of_the_studies_that_are_shipped_can_be_made(name: str) -> None:
    study = load_study(STUDIES / f"{name}.yaml")
    samples = map(study.data_set.sample, range(study.data_set.plan.size))
    views = {(s.scene_name, *s.parameters["scene.drone.turn_deg"]): s for s in samples}
    assert len(views) == len(study.plan.scenes) * study.study.rounds
    for sample in views.values():
        load(sample)


def test_a_quick_setting_changes_what_it_names(tmp_path: Path) -> None:
    quick = {
        "transport_noise_share": 0.1,
        "study": {"rounds": 1},
        "vary": {"scene.fog.kind": "haze-l"},
    }
    small = planned(tmp_path, study={"quick": quick}).quick()
    assert small.plan.sampling_budget == {"transport_noise_share": 0.1}
    assert small.study.rounds == 1
    assert small.study.metrics == ("range_bias_m",)
    assert list(small.plan.vary) == ["scene.fog.visibility_m", "scene.fog.kind"]


BAD: list[tuple[dict[str, Any], str]] = [
    (
        {"study": {"metrics": ["depth_mea_m"]}},
        r"study: unknown metric .*did you mean 'depth_mae_m'",
    ),
    ({"study": {"metrics": []}}, r"study.metrics: should have at least 1 items"),
    ({"study": {"metrics": ["saturated", "saturated"]}}, r"saturated is repeated"),
    ({"study": {"x": "scene.fog.visibility"}}, r"did you mean 'scene.fog.visibility_m'"),
    ({"study": {"x": "scene.fog.kind"}}, r"'scene.fog.kind' is not among the grids"),
    ({"study": {"groups": [""]}}, r"study.groups\[0\]: .*at least 1 character"),
    ({"study": {"groups": ["scene.fog.visibility_m"]}}, r"visibility_m is repeated"),
    ({"study": {"grups": []}}, r"unknown field 'grups': did you mean 'groups'"),
    ({"study": {"rounds": 0}}, r"study.rounds"),
    ({"vary": {}}, r"needs a grid to compare"),
    ({"vary": {"scene.fog.visibility_m": {"uniform": [20, 30]}}}, r"needs a grid to compare"),
    ({"samples": 4}, r"samples follow from study.rounds"),
    ({"keep": {"truth": False}}, r"needs keep.truth"),
    (
        {"vary": {"scene.fog.visibility_m": {"grid": [{"uniform": [20, 30]}, 50]}}},
        r"'scene.fog.visibility_m' is random; it should have the same values in all rounds",
    ),
    ({"instrument": 7}, r"instrument: should be a name, or a grid of names"),
    ({"instrument": {"grid": ["paper", 7]}}, r"instrument: should be a name, or a grid of names"),
    (
        {"instrument": {"grid": ["paper", "fga015"]}},
        r"do not distinguish all combinations; add instrument to groups",
    ),
    (
        {"vary": {"weather": {"grid": [{"fog": None}]}}},
        r"weather should begin with scene. or instrument., or have mappings of such",
    ),
    (
        {
            "vary": {"scene.ambient.sky_klx": {"grid": [0, 1]}},
            "study": {"x": "scene.ambient.sky_klx", "x_scale": "log"},
        },
        r"x_scale log needs positive numbers; found 0",
    ),
]


@pytest.mark.parametrize(("changes", "message"), BAD)
def test_bad_plans_are_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        planned(tmp_path, **changes)
    assert str(tmp_path / "plan.yaml") in str(caught.value)


def test_a_plan_without_a_study_or_a_quick_setting_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"study\.quick is missing"):
        planned(tmp_path).quick()
    (tmp_path / "set.yaml").write_text(yaml.safe_dump({**PLAN, "study": None}))
    with pytest.raises(InputError, match="study: should be a mapping of fields"):
        load_study(tmp_path / "set.yaml")
    bad = planned(tmp_path, study={"quick": {"transport_noise": 0.1}})
    with pytest.raises(
        InputError,
        match=r"study.quick: unknown field 'transport_noise': did you mean 'transport_noise_share'",
    ):
        bad.quick()
    with pytest.raises(InputError, match=r"study.quick.vary: should be a mapping of fields; found"):
        planned(tmp_path, study={"quick": {"vary": None}}).quick()
