"""Plans of data sets: what a sample depends on."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from dataplans import PLAN, mistake, planned
from spisim.dataset.plan import MAX_SAMPLES
from spisim.dataset.planned import PlannedSet, Sample
from spisim.dataset.preview import check
from spisim.dataset.sample import load


def reported(plan: PlannedSet, name: str) -> list[Any]:
    return [plan.sample(index).parameters.get(name) for index in range(plan.plan.size)]


def test_a_sample_is_the_same_whatever_came_before(tmp_path: Path) -> None:
    plan = planned(tmp_path)
    samples = [plan.sample(index) for index in range(12)]
    again = planned(tmp_path)
    assert [again.sample(index) for index in reversed(range(12))] == samples[::-1]
    assert len({sample.seed for sample in samples}) == 12
    assert len({sample.parameters["scene.fog.visibility_m"] for sample in samples}) == 12


def test_a_section_is_told_as_the_plan_has_it(tmp_path: Path) -> None:
    vary = {"scene.fog": {"kind": "haze-l"}, "scene.fog.visibility_m": 30}
    sample = planned(tmp_path, vary=vary).sample(0)
    assert {name: sample.parameters[name] for name in vary} == vary
    assert sample.scene_fields["fog"] == {"kind": "haze-l", "visibility_m": 30}


def test_the_texts_say_what_the_parameters_say(tmp_path: Path) -> None:
    plan = planned(tmp_path)
    for index in range(10):
        sample = plan.sample(index)
        scene, instrument = (
            sample.scene_fields,
            sample.instrument_fields,
        )
        parameters = sample.parameters
        assert scene["fog"]["visibility_m"] == parameters["scene.fog.visibility_m"]
        assert scene["drone"]["offset_m"] == parameters["scene.drone.offset_m"]
        assert scene["material_swaps"]["concrete"] == parameters["materials.concrete"]
        assert instrument["lasers"]["power_w"] == parameters["instrument.lasers.power_w"]
        if parameters["scene"] == "targets":
            assert scene["parameters"]["distance_m"] == parameters["parameters.distance_m"]
            assert scene["seed"] == parameters["family_seed"]


def test_weights_say_how_often_a_scene_comes(tmp_path: Path) -> None:
    scenes = reported(planned(tmp_path), "scene")
    assert 24 <= scenes.count("targets") <= 36  # 30 expected, sigma 2.7
    assert scenes.count("targets") + scenes.count("warehouse") == 40


def test_another_open_field_leaves_the_others(tmp_path: Path) -> None:
    before = [planned(tmp_path).sample(index) for index in range(8)]
    vary = yaml.safe_load(PLAN)["vary"]
    more = {"scene.ambient.sky_klx": {"uniform": [0.1, 1.0]}, **vary}
    after = [planned(tmp_path, vary=more).sample(index) for index in range(8)]
    for old, new in zip(before, after, strict=True):
        added = dict(new.parameters)
        assert 0.1 <= added.pop("scene.ambient.sky_klx") <= 1
        assert added == old.parameters
        assert new.seed == old.seed


def test_another_seed_is_another_set(tmp_path: Path) -> None:
    name = "scene.fog.visibility_m"
    assert not set(reported(planned(tmp_path), name)) & set(
        reported(planned(tmp_path, seed=1), name)
    )


def test_grids_run_through_all_combinations(tmp_path: Path) -> None:
    plan = planned(
        tmp_path,
        samples=18,
        vary={
            "scene.fog.visibility_m": {"grid": [20, 50, 100]},
            "instrument.lasers.power_w": {"uniform": [0.001, 0.005]},
        },
        materials={"concrete": {"grid": ["cardboard", "wood-dry"]}},
    )
    assert plan.plan.combinations == 6
    samples = [plan.sample(index) for index in range(18)]
    pairs = [
        (sample.parameters["scene.fog.visibility_m"], sample.parameters["materials.concrete"])
        for sample in samples
    ]
    assert pairs[:3] == [(20, "cardboard"), (20, "wood-dry"), (50, "cardboard")]
    assert len(set(pairs)) == 6
    assert pairs[:6] == pairs[6:12] == pairs[12:]
    for round_ in (samples[:6], samples[6:12], samples[12:]):
        for name in ("instrument.lasers.power_w", "scene", "family_seed"):
            assert len({sample.parameters.get(name) for sample in round_}) == 1
        assert len({sample.scene_name for sample in round_}) == 1
        assert len({sample.seed for sample in round_}) == 6
    powers = {sample.parameters["instrument.lasers.power_w"] for sample in samples}
    assert len(powers) == 3


def test_every_scene_is_an_axis_and_the_size_follows(tmp_path: Path) -> None:
    vary = {"scene.fog.visibility_m": {"grid": [20, 50]}}
    plan = planned(tmp_path, samples=None, every_scene=True, vary=vary)
    assert plan.plan.size == 4
    assert reported(plan, "scene") == ["targets", "targets", "warehouse", "warehouse"]


def test_values_of_a_grid_may_be_drawn_themselves(tmp_path: Path) -> None:
    vary = {"scene.fog": {"grid": [{"visibility_m": {"uniform": [20.0, 30.0]}}, None]}}
    plan = planned(tmp_path, samples=4, vary=vary)
    for index in (0, 2):
        assert 20 <= plan.sample(index).parameters["scene.fog"]["visibility_m"] <= 30
        assert "fog" not in plan.sample(index + 1).scene_fields


def test_values_of_a_choice_may_be_drawn_themselves(tmp_path: Path) -> None:
    fogs = [
        {"kind": "hazer", "visibility_m": {"uniform": [20.0, 30.0]}},
        {"kind": "haze-l", "visibility_m": {"choice": [{"log_uniform": [50.0, 60.0]}]}},
    ]
    values = reported(planned(tmp_path, vary={"scene.fog": {"choice": fogs}}), "scene.fog")
    hazer = [fog["visibility_m"] for fog in values if fog["kind"] == "hazer"]
    haze = [fog["visibility_m"] for fog in values if fog["kind"] == "haze-l"]
    assert len({*hazer, *haze}) == len(values) == 40
    assert 20 <= min(hazer) < max(hazer) <= 30
    assert 50 <= min(haze) < max(haze) <= 60


def test_instrument_and_scene_move_to_another_wavelength(tmp_path: Path) -> None:
    vary = {"instrument.lasers.power_w": 3e-3, "scene.drone.turn_deg": [0, 0, {"normal": [0, 3]}]}
    plan = planned(tmp_path, samples=4, vary=vary, wavelength_nm={"grid": [905, 1550]})
    assert reported(plan, "wavelength_nm") == [905, 1550, 905, 1550]
    for index, wavelength_nm in enumerate([905, 1550]):
        scene, instrument = load(plan.sample(index))
        assert scene.wavelength_nm == instrument.wavelength_nm == wavelength_nm
        low, high = instrument.filter.band_nm
        assert low < wavelength_nm < high
        assert instrument.lasers.power_w == 3e-3


def test_distinct_scenes_come_again_as_they_were(tmp_path: Path) -> None:
    family = {
        "family": "targets",
        "distinct": 3,
        "parameters": {"distance_m": {"uniform": [2.0, 4.0]}},
    }
    plan = planned(tmp_path, scenes=[family])
    samples = [plan.sample(index) for index in range(40)]
    scenes: dict[str, Sample] = {}
    for sample in samples:
        first = scenes.setdefault(sample.scene_name, sample)
        name = "parameters.distance_m"
        assert sample.parameters[name] == first.parameters[name]
    assert len(scenes) == 3
    assert len({sample.parameters["scene.fog.visibility_m"] for sample in samples}) == 40


def test_a_section_before_its_fields(tmp_path: Path) -> None:
    fog = {"scene.fog": {"kind": "haze-l"}, "scene.fog.visibility_m": {"uniform": [20.0, 30.0]}}
    plan = planned(tmp_path, vary=fog)
    samples = [plan.sample(index).scene_fields["fog"] for index in (0, 1)]
    assert samples[0]["kind"] == samples[1]["kind"] == "haze-l"
    assert samples[0]["visibility_m"] != samples[1]["visibility_m"]
    message = mistake(tmp_path, vary=dict(reversed(fog.items())))
    assert "vary: scene.fog should precede scene.fog.visibility_m" in message


def test_a_choice_of_sections_is_not_changed_by_the_samples(tmp_path: Path) -> None:
    vary = {
        "scene.fog": {"choice": [{"kind": "haze-l"}]},
        "scene.fog.visibility_m": {"choice": [20, 30]},
    }
    plan = planned(tmp_path, vary=vary)
    for index in range(4):
        plan.sample(index)
    assert plan.plan.vary["scene.fog"] == {"choice": [{"kind": "haze-l"}]}


def test_the_digest_tells_everything_but_the_number_of_samples(tmp_path: Path) -> None:
    digest = planned(tmp_path).digest
    assert planned(tmp_path, samples=7).digest == digest
    assert planned(tmp_path).with_samples(9).digest == digest
    assert planned(tmp_path).with_samples(9).plan.size == 9
    changes: list[dict[str, Any]] = [
        {"seed": 1},
        {"spp": 7},
        {"frames": 2},
        {"instrument": "fga015"},
        {"scenes": [{"family": "targets"}]},
        {"keep": {"truth": False}},
        {"vary": {}},
    ]
    digests = {planned(tmp_path, **change).digest for change in changes}
    assert len(digests | {digest}) == len(changes) + 1


def test_files_beside_the_plan_come_first(tmp_path: Path) -> None:
    own = tmp_path / "rooms" / "mine.yaml"
    own.parent.mkdir()
    own.write_text("name: mine\n")
    (tmp_path / "rig.yaml").write_text("wavelength_nm: 1550\n")
    plan = planned(tmp_path, scenes=[{"scene": "rooms/mine.yaml"}], instrument="rig.yaml", vary={})
    sample = plan.sample(0)
    assert sample.scene_name == "mine"
    assert sample.scene_folder == own.parent
    assert sample.instrument_fields == {"wavelength_nm": 1550}
    digest = plan.digest
    own.write_text("name: other\n")
    assert plan.sample(0).scene_name == "mine"  # as it was when the plan was first asked
    assert planned(tmp_path, **plan.fields).digest != digest


@pytest.mark.parametrize(
    ("content", "name"),
    [
        ("family: person\nseed: 3\n", "person-3"),
        ("family: person\n", "person-0"),
        ("name: mine\nfamily: person\n", "mine"),
        ("objects: []\n", "room.yaml"),
    ],
)
def test_scenes_of_files_have_names_of_their_own(tmp_path: Path, content: str, name: str) -> None:
    (tmp_path / "room.yaml").write_text(content)
    plan = planned(tmp_path, scenes=[{"scene": "room.yaml"}], vary={}, materials={})
    assert plan.sample(0).scene_name == name


def test_a_material_of_a_scene_alone_may_be_replaced(tmp_path: Path) -> None:
    paint = {"reflectance": 0.3, "source": "a guess"}
    wall = {"name": "wall", "shape": "box", "size_m": [1, 1, 1], "material": "my paint"}
    scene = {
        "name": "own",
        "drone": {"position_m": [-4, 0, 0], "look_at_m": [0, 0, 0]},
        "materials": {"my paint": paint},
        "objects": [wall],
    }
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(scene))
    own, shipped = {"scene": "own.yaml"}, {"scene": "target-plane"}
    check(planned(tmp_path, scenes=[own, shipped], materials={"my paint": "cardboard"}))


def test_every_flight_has_a_seed_of_its_own(tmp_path: Path) -> None:
    """Both frames of a flight share it; no other flight has it, of this plan or of another seed."""
    poses = {"count": 2, "flight_s": 1.0}
    plans = [planned(tmp_path, samples=240, seed=seed, poses=poses) for seed in (0, 1)]
    seeds = [plan._pose_seed(round_) for plan in plans for round_ in range(120)]
    assert len(set(seeds)) == len(seeds) / 2


def test_as_many_samples_as_can_be_made_are_a_plan(tmp_path: Path) -> None:
    assert planned(tmp_path, samples=MAX_SAMPLES).plan.size == MAX_SAMPLES
    assert str(MAX_SAMPLES) in mistake(tmp_path, samples=MAX_SAMPLES + 1)
