"""Several poses of one scene: the same surfaces, other views, each one to fly in."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from reconstruction.base.errors import InputError
from spisim.dataset.planned import PlannedSet, load_plan
from spisim.dataset.poses import Poses, View
from spisim.dataset.sample import load
from spisim.scene import draw_scene, make_scene
from spisim.scene.layout import OFFERED, layout_problem

HALL = """
name: hall
drone: {position_m: [0, 0, 1.5], look_at_m: [5, 0, 1.5], DRONE}
objects: [{name: wall, shape: box, size_m: [0.1, 40, 40], material: concrete,
           translate_m: [5, 0, 1.5]}]
"""


def planned(folder: Path, **fields: Any) -> PlannedSet:
    path = folder / "plan.yaml"
    plan = {"name": "poses", "samples": 8, "scenes": [{"family": "targets"}], "spp": 8, **fields}
    path.write_text(yaml.safe_dump(plan))
    return load_plan(path)


def test_poses_of_a_scene_follow_each_other(tmp_path: Path) -> None:
    plan = planned(tmp_path, poses=3, vary={"scene.fog.visibility_m": {"uniform": [20.0, 90.0]}})
    samples = [plan.sample(index) for index in range(8)]
    assert [sample.parameters["pose"] for sample in samples] == [0, 1, 2, 0, 1, 2, 0, 1]
    names = [sample.scene_name for sample in samples]
    assert names[0] == names[1] == names[2] != names[3] == names[4] == names[5] != names[6]
    assert len({sample.parameters["scene.fog.visibility_m"] for sample in samples}) == 8
    assert [plan.world_of(index) for index in range(8)] == [0, 0, 0, 3, 3, 3, 6, 6]


def test_grids_run_through_every_pose(tmp_path: Path) -> None:
    plan = planned(tmp_path, poses=2, instrument={"grid": ["paper", "apd"]})
    samples = [plan.sample(index) for index in range(8)]
    assert [sample.parameters["pose"] for sample in samples] == [0, 0, 1, 1, 0, 0, 1, 1]
    poses = [load(sample)[0].drone_pose for sample in samples[2:4]]
    np.testing.assert_array_equal(*poses)


def test_one_pose_is_what_a_plan_without_them_has(tmp_path: Path) -> None:
    one, none = planned(tmp_path, poses=1).sample(3), planned(tmp_path).sample(3)
    assert one.scene_fields == none.scene_fields
    assert "pose" not in one.parameters
    several = planned(tmp_path, poses=4)
    assert several.sample(4).scene_fields == planned(tmp_path).sample(1).scene_fields


def test_surfaces_are_made_once_and_seen_from_elsewhere(tmp_path: Path) -> None:
    plan = planned(tmp_path, poses=4)
    own, *others = [load(plan.sample(index))[0] for index in range(4)]
    for other in others:
        assert other.objects is own.objects
        assert not np.allclose(other.drone_pose, own.drone_pose)
        assert layout_problem(other, OFFERED) is None
        again = make_scene(other.text, tmp_path, "again")
        np.testing.assert_allclose(again.drone_pose, other.drone_pose, atol=1e-12)
    assert len({scene.drone_pose.tobytes() for scene in (own, *others)}) == 4
    alone = load(planned(tmp_path, poses=4).sample(2))[0]
    np.testing.assert_array_equal(alone.drone_pose, others[1].drone_pose)


def test_poses_fill_the_range_that_is_told() -> None:
    hall = make_scene(HALL.replace("DRONE", "turn_deg: [0, 0, 0]"), Path(), "hall")
    spread = Poses(count=200, offset_m=(1.0, 2.0, 0.5), turn_deg=(4, 8, 12))
    drones = [yaml.safe_load(View(k, spread, k).of(hall).text)["drone"] for k in range(1, 200)]
    for name in ("offset_m", "turn_deg"):
        drawn, widest = np.array([drone[name] for drone in drones]), getattr(spread, name)
        assert (np.abs(drawn) <= widest).all()
        sigma = np.std(drawn / widest, axis=0)
        np.testing.assert_allclose(sigma, 1 / np.sqrt(3), rtol=0.2)
        assert np.abs(np.mean(drawn / widest, axis=0)).max() < 4 / np.sqrt(3 * len(drones))


def test_a_pose_comes_in_addition_to_the_files_own() -> None:
    hall = make_scene(
        HALL.replace("DRONE", "turn_deg: [3, 10, -20], offset_m: [0.5, 0, 0.2]"), Path(), "hall"
    )
    seen = View(1, Poses(count=2), 7).of(hall)
    again = make_scene(seen.text, Path(), "again")
    np.testing.assert_allclose(again.drone_pose, seen.drone_pose, atol=1e-6)
    moved_m = np.linalg.norm(seen.drone_pose[:3, 3] - hall.drone_pose[:3, 3])
    assert 0 < moved_m <= np.linalg.norm([1, 1, 0.5])


def test_where_there_is_no_room_poses_are_drawn_from_ever_nearer() -> None:
    """In a shaft 1.2 m wide nothing is free 0.4 m around but near its axis."""
    walls = [
        f"{{name: wall {side}, shape: box, size_m: [20, 0.1, 20], material: concrete,"
        f" translate_m: [0, {side * 0.65}, 0]}}"
        for side in (-1, 1)
    ]
    end = (
        "{name: end, shape: box, size_m: [0.1, 20, 20], material: concrete, translate_m: [5, 0, 0]}"
    )
    text = f"""
name: shaft
drone: {{position_m: [0, 0, 0], look_at_m: [5, 0, 0]}}
objects: [{", ".join([*walls, end])}]
"""
    shaft = make_scene(text, Path(), "shaft")
    spread = Poses(count=9, offset_m=(0.5, 4.0, 0.5), turn_deg=(5, 5, 5))
    for number in range(1, 9):
        seen = View(number, spread, number).of(shaft)
        assert abs(seen.drone_pose[1, 3]) <= 0.2
    nowhere = make_scene(text.replace("0.65", "0.4"), Path(), "shaft")
    with pytest.raises(InputError, match="'shaft': the drone cannot fly in any of 40 poses"):
        View(1, spread, 1).of(nowhere)


def test_a_moment_of_a_flight_has_one_pose() -> None:
    moment = "moment: {time_s: 0, position_m: [0, 0, 1.5], look_at_m: [5, 0, 1.5]}"
    scene = draw_scene("targets", 0)
    flown = type(scene)(**{**vars(scene), "text": scene.text + moment})
    assert View(0, Poses(), 0).of(flown) is flown
    with pytest.raises(InputError, match="a scene with `moment` has a single pose"):
        View(1, Poses(count=2), 0).of(flown)


@pytest.mark.parametrize(
    ("poses", "reported"),
    [
        (0, "poses: should be"),
        (20_000, "poses: should be"),
        ("many", "poses: should be a valid integer.*found 'many'"),
        (True, "poses: should be a number; found True"),
        ({"count": 2, "offset_m": [1, -1, 0]}, r"poses.offset_m\[1\]: should be"),
        ({"count": 2, "turn_deg": [0, 0, 200]}, r"poses.turn_deg\[2\]: should be"),
        ({"counts": 2}, "poses: unknown field 'counts': did you mean 'count'"),
    ],
)
def test_poses_that_cannot_be(tmp_path: Path, poses: Any, reported: str) -> None:
    with pytest.raises(InputError, match=reported):
        planned(tmp_path, poses=poses)


def test_a_flight_leads_through_every_scene_at_equal_steps(tmp_path: Path) -> None:
    plan = planned(tmp_path, poses={"count": 4, "flight_s": 1.5, "offset_m": [1, 1, 0.2]})
    first, *others = [load(plan.sample(index))[0] for index in range(4)]
    own = load(planned(tmp_path).sample(0))[0]
    np.testing.assert_allclose(first.drone_pose, own.drone_pose, atol=1e-12)
    steps = np.diff([scene.drone_pose[:3, 3] for scene in (first, *others)], axis=0)
    np.testing.assert_allclose(steps, steps[:1].repeat(3, axis=0), atol=1e-9)
    for scene in (first, *others):
        np.testing.assert_allclose(scene.drone_velocity_m_s, steps[0] / 0.5, atol=1e-9)
        assert layout_problem(scene, OFFERED) is None
        again = make_scene(scene.text, tmp_path, "again")
        np.testing.assert_allclose(again.drone_pose, scene.drone_pose, atol=1e-12)
    elsewhere = load(plan.sample(4))[0], load(plan.sample(5))[0]
    assert not np.allclose(np.subtract(*(each.drone_pose[:3, 3] for each in elsewhere)), -steps[0])


def test_a_flight_of_one_pose_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"poses.*1; a flight needs at least 2 poses"):
        planned(tmp_path, poses={"flight_s": 2.0})
