"""What programs of others are given, read back without the code that wrote it."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

import spisim.dataset
from datasets import make_set
from exported import nerf_points, read_pcd, with_scene
from reconstruction import InputError, reconstruct, write_capture
from reconstruction.cli import main
from reconstruction.depth import pixel_rays
from reconstruction.exports.poses import OPTICAL_IN_BODY, quaternion_of, read_poses, rotation
from reconstruction.outputs.result_file import result_bytes
from spisim.dataset import EXPORTS
from spisim.dataset.poses import placed
from spisim.scene import make_scene
from streams import film


@pytest.fixture(scope="module")
def recording(capture):
    return with_scene(film(capture, 3))


@pytest.fixture
def file(recording, tmp_path):
    write_capture(recording, tmp_path / "flight.h5")
    return tmp_path / "flight.h5"


@pytest.fixture(scope="module")
def poses(recording):
    return [placed(recording, number).pose for number in range(3)]


@pytest.fixture
def pose_file(poses, tmp_path):
    rows = ["# by motion capture"]
    for number, pose in enumerate(poses):
        numbers = [100 + number / 10, *pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
        rows.append(" ".join(map(repr, map(float, numbers))))
    (tmp_path / "poses.txt").write_text("\n".join(rows))
    return tmp_path / "poses.txt"


def export(*words):
    assert main(["export", *map(str, words)]) == 0


def picture(path):
    with Image.open(path) as image:
        return image.mode, np.array(image)


def test_quaternions_are_those_of_scipy():
    turns = Rotation.random(200, rng=1)
    # and half turns, where components vanish
    turns = Rotation.concatenate([turns, Rotation.from_rotvec(np.pi * np.eye(3)), turns[:1] ** 0])
    for turn in turns:
        result = quaternion_of(turn.as_matrix())
        assert np.allclose(result, turn.as_quat(canonical=True), atol=1e-12) or np.allclose(
            -result, turn.as_quat(canonical=True), atol=1e-12
        )
        assert np.allclose(rotation(result), turn.as_matrix(), atol=1e-12)


def test_poses_are_those_of_the_scene_in_the_middle_of_each_frame(recording, tmp_path):
    scene = make_scene(recording.provenance.scene, tmp_path, "hall")
    period_s = recording.plan.exposures / 15_000
    for number in range(3):
        expected = scene.drone_pose_at((number + 0.5) * period_s)
        assert placed(recording, number).pose == pytest.approx(expected, abs=1e-12)
        assert placed(recording, number).time_s is None
    drawn = with_scene(recording, "family: targets\nseed: 3\ndrone: {offset_m: [0.5, 0, 0]}\n")
    scene = make_scene(drawn.provenance.scene, tmp_path, "targets")
    assert placed(drawn, 0).pose == pytest.approx(scene.drone_pose, abs=1e-12)
    assert placed(replace(recording, provenance=replace(recording.provenance, scene="")), 0) is None


def test_depth_is_along_the_axis_in_millimetres(recording, file, tmp_path, pose_file):
    export(file, "-o", tmp_path / "out", "--poses", pose_file)
    for number in range(3):
        result = reconstruct(recording, number, image="edge-preserving")
        mode, depth = picture(tmp_path / "out" / "depth" / f"00000{number}.png")
        assert mode.startswith("I;16")
        assert depth.dtype.itemsize == 2
        expected = np.rint(1000 * result.depth_m.astype(float))
        assert (depth == np.where(np.isfinite(expected), expected, 0)).all()
        assert not np.allclose(depth, 1000 * result.range_m, atol=1)
        mode, colour = picture(tmp_path / "out" / "rgb" / f"00000{number}.png")
        assert mode == "RGB"
        assert np.abs(colour[..., 1] - 255 * result.image / result.image.max()).max() <= 0.5


def test_intrinsics_unproject_to_the_cloud(recording, file, tmp_path):
    export(file, "-o", tmp_path / "out")
    fields = json.loads((tmp_path / "out" / "camera_intrinsic.json").read_text())
    matrix = np.array(fields["intrinsic_matrix"]).reshape(3, 3).T  # Open3D has columns
    u, v = np.meshgrid(np.arange(fields["width"]), np.arange(fields["height"]))
    rays = np.stack([(u - matrix[0, 2]) / matrix[0, 0], (v - matrix[1, 2]) / matrix[1, 1],
                     np.ones(u.shape)], axis=-1)  # fmt: skip
    assert rays == pytest.approx(pixel_rays(recording.optics, recording.plan.shape), abs=1e-12)


def test_lists_of_times_and_poses_are_as_in_the_tum_benchmark(poses, file, tmp_path, pose_file):
    export(file, "-o", tmp_path / "out", "--poses", pose_file)
    rows = (tmp_path / "out" / "associations.txt").read_text().splitlines()
    pairs = [row.split() for row in rows if not row.startswith("#")]
    assert [pair[0] for pair in pairs] == ["100.000000", "100.100000", "100.200000"]
    for stamp, colour, other, depth in pairs:
        assert stamp == other
        assert (tmp_path / "out" / colour).is_file()
        assert (tmp_path / "out" / depth).is_file()
    table = np.loadtxt(tmp_path / "out" / "groundtruth.txt")
    for row, pose in zip(table, poses, strict=True):
        assert row[1:4] == pytest.approx(pose[:3, 3], abs=1e-7)
        assert Rotation.from_quat(row[4:]).as_matrix() == pytest.approx(pose[:3, :3], abs=1e-7)
    export(file, "-o", tmp_path / "unplaced")
    assert not (tmp_path / "unplaced" / "groundtruth.txt").exists()
    stamps = np.loadtxt(tmp_path / "unplaced" / "depth.txt", usecols=0)
    period_s = 2 * 128 / 15_000
    assert np.diff(stamps) == pytest.approx(period_s, abs=2e-6)
    assert stamps[0] == pytest.approx(1767225600 + period_s / 2, abs=1e-5)  # created, in 2026


def test_nerf_sees_what_the_cloud_has(recording, poses, file, tmp_path, pose_file):
    export(file, "-o", tmp_path / "out", "--format", "nerf", "--poses", pose_file)
    for number, pose in enumerate(poses):
        depth_m = reconstruct(recording, number).depth_m
        points = pixel_rays(recording.optics, recording.plan.shape) * depth_m[..., None]
        expected = points @ pose[:3, :3].T + pose[:3, 3]
        assert nerf_points(tmp_path / "out", number, depth_m) == pytest.approx(expected, abs=1e-6)
    fields = json.loads((tmp_path / "out" / "transforms.json").read_text())
    assert fields["camera_angle_x"] == pytest.approx(2 * np.arctan(0.1))
    for frame in fields["frames"]:
        assert picture(tmp_path / "out" / frame["file_path"])[1].shape == (16, 16, 3)
        assert picture(tmp_path / "out" / frame["depth_file_path"])[1].shape == (16, 16)


def test_pcd_has_the_cloud_and_where_it_was_seen_from(recording, poses, file, tmp_path, pose_file):
    export(file, "-o", tmp_path / "out", "--format", "pcd", "--poses", pose_file)
    result = reconstruct(recording, 2, image="edge-preserving")
    points, viewpoint = read_pcd((tmp_path / "out" / "000002.pcd").read_bytes())
    expected = pixel_rays(recording.optics, recording.plan.shape) * result.depth_m[..., None]
    outcome = np.stack([points[axis] for axis in "xyz"], axis=-1)
    assert np.array_equal(outcome, expected.astype("f4"), equal_nan=True)
    assert np.array_equal(points["intensity"], result.image)
    w, x, y, z = viewpoint[3:]
    assert viewpoint[:3] == pytest.approx(poses[2][:3, 3], abs=1e-7)
    turn = Rotation.from_quat([x, y, z, w]).as_matrix()
    assert turn == pytest.approx(poses[2][:3, :3], abs=1e-7)
    # what is ahead in the optical frame is ahead in the body's
    assert (OPTICAL_IN_BODY @ [0, 0, 1, 1]).tolist() == [1, 0, 0, 1]


def test_an_earlier_export_is_replaced_and_nothing_else_is(file, tmp_path, capsys):
    out = tmp_path / "out"
    export(file, "-o", out)
    export(file, "-o", out, "--format", "pcd")
    assert sorted(path.name for path in out.iterdir()) == [f"00000{n}.pcd" for n in range(3)]
    (out / "mine.txt").write_text("mine")
    assert main(["export", str(file), "-o", str(out)]) == 2
    assert (
        "mine.txt is not part of an earlier export; choose an empty folder"
        in capsys.readouterr().err
    )
    assert main(["export", str(file), "-o", str(tmp_path)]) == 2
    assert "is read by this command" in capsys.readouterr().err
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--format", "rgdb"], "unknown export format 'rgdb': did you mean 'rgbd'?"),
        (["-o", "out.pdc"], "unknown export extension '.pdc'"),
        (["--format", "nerf"], "frame 0 has no pose, .* add --poses FILE"),
        (["--poses", "none.txt"], "none.txt: no such file of poses"),
        (["--depth", "nearst"], "unknown depth method 'nearst': did you mean 'nearest'"),
        (["-o", "flight.h5/out"], "flight.h5 is not a folder"),
    ],
)
def test_what_cannot_be_exported_is_told(words, message, file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    assert main(["export", str(file), "-o", "out", *words]) == 2
    assert re.search(message, capsys.readouterr().err)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0 0 0 0 0 0 0 1", "1 poses for 3 frames; one each is needed"),
        ("0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1", "line 2: time 0 must be later than the one before"),
        ("0 0 0 0 0 0 1", "line 1: 7 columns, not 8"),
        ("0 0 0 nan 0 0 0 1", "line 1: tz must be a number within"),
        ("0 0 0 0 0 0 0 2", "line 1: qx qy qz qw must have length 1, not 2"),
    ],
)
def test_poses_that_are_none_are_told_with_their_line(rows, message, file, tmp_path, capsys):
    (tmp_path / "p.txt").write_text(rows)
    out = tmp_path / "out"
    assert main(["export", str(file), "-o", str(out), "--poses", str(tmp_path / "p.txt")]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


def test_without_time_of_flight_or_optics_there_is_no_depth(recording, tmp_path, capsys):
    for name, part in (("dark", "spots"), ("blind", "optics")):
        path = tmp_path / f"{name}.h5"
        write_capture(replace(recording, **{part: None}), path)
        for form in ("rgbd", "pcd"):
            assert main(["export", str(path), "-o", str(tmp_path / "o"), "--format", form]) == 2
            messages = capsys.readouterr().err
            assert ("no depth map" if part == "spots" else "no optics") in messages
    assert sorted(path.name for path in tmp_path.iterdir()) == ["blind.h5", "dark.h5"]


@pytest.fixture(scope="module")
def data(capture, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sets") / "walls"
    return spisim.dataset.open(make_set(folder, with_scene(capture)))[:4]


def test_a_data_set_has_an_index_as_coco(data, tmp_path):
    EXPORTS["coco"](data, tmp_path / "coco", 0)
    index = json.loads((tmp_path / "coco" / "index.json").read_text())
    assert [row["id"] for row in index["images"]] == [1, 2, 3, 4]
    (category,) = index["categories"]
    assert category["keypoints"] == ["spot 0", "spot 1", "spot 2", "spot 3"]
    for sample, row, note in zip(data, index["images"], index["annotations"], strict=True):
        assert row["sample"] == sample.index
        assert row["parameters"] == dict(sample.parameters)
        depth = picture(tmp_path / "coco" / row["depth_file_name"])[1]
        assert (depth == np.rint(1000 * sample.capture.truth.depth_m[0])).all()
        assert picture(tmp_path / "coco" / row["file_name"])[1].shape == (16, 16, 3)
        assert (note["image_id"], note["category_id"], note["num_keypoints"]) == (row["id"], 1, 4)
        assert note["range_m"] == pytest.approx([4.2, 4.7, 4.3, 4.8], abs=1e-6)
        x, y, seen = np.reshape(note["keypoints"], (4, 3)).T
        assert x == pytest.approx([3.5, 11.5, 3.5, 11.5])  # tangents of 0.05 in 0.1
        assert y == pytest.approx([3.5, 3.5, 11.5, 11.5])
        assert (seen == 2).all()


@pytest.mark.parametrize("form", ["rgbd", "nerf", "pcd"])
def test_a_data_set_has_a_folder_for_each_scene(form, data, tmp_path):
    written = EXPORTS[form](data, tmp_path / form, 0)
    again = EXPORTS[form](data, tmp_path / "again", 0)
    assert [path.read_bytes() for path in written] == [path.read_bytes() for path in again]
    scenes = [sample.scene_name for sample in data]
    assert sorted(path.name for path in (tmp_path / form).iterdir()) == sorted(set(scenes))
    true_m = data[2].capture.truth.depth_m[0]
    inside = tmp_path / form / scenes[2]
    if form == "pcd":
        assert read_pcd((inside / "000000.pcd").read_bytes())[0]["z"] == pytest.approx(true_m)
    else:
        assert (picture(inside / "depth" / "000000.png")[1] == np.rint(1000 * true_m)).all()


def test_a_data_set_without_samples_or_truth_is_refused(data, capture, tmp_path):
    with pytest.raises(InputError, match="no finished samples to export"):
        EXPORTS["coco"](data[:0], tmp_path / "out", 0)
    with pytest.raises(InputError, match="is read by this command"):
        EXPORTS["rgbd"](data, data.folder, 0)
    blind = make_set(tmp_path / "blind", with_scene(capture), done=1)
    path = spisim.dataset.open(blind)[0].path
    write_capture(replace(with_scene(capture), truth=None), path)
    with pytest.raises(InputError, match=r"000000\.h5: holds no truth"):
        EXPORTS["nerf"](spisim.dataset.open(blind), tmp_path / "out", 0)
    assert not (tmp_path / "out").exists()


def test_a_result_is_exported_as_its_capture_is(recording, file, tmp_path, capsys):
    """Its optics follow from the lengths of the pixels' rays."""
    result = tmp_path / "result.h5"
    result.write_bytes(result_bytes(reconstruct(recording)))
    export(result, "-o", tmp_path / "a", "--format", "pcd")
    export(file, "-o", tmp_path / "b", "--format", "pcd")
    ours, theirs = (
        read_pcd((tmp_path / name / "000000.pcd").read_bytes())[0] for name in ("a", "b")
    )
    for axis in "xyz":
        np.testing.assert_allclose(ours[axis], theirs[axis], rtol=1e-5, atol=1e-6)
    assert main(["export", str(result), "-o", str(tmp_path / "c"), "--depth", "nope"]) != 0
    assert "holds no depth by 'nope'" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_poses_may_be_far_off_and_late_but_not_beyond_what_is_meant(tmp_path):
    """Ten thousand million seconds are 317 years, metres 67 distances of the sun."""
    path = tmp_path / "poses.txt"
    path.write_text("9999999999 -9999999999 0 0 0 0 0 1\n")
    (result,) = read_poses(path)
    assert result.time_s == -result.pose[0, 3] == 9_999_999_999
    path.write_text("0 10000000001 0 0 0 0 0 1\n")
    with pytest.raises(InputError, match="tx must be a number within ±1e\\+10"):
        read_poses(path)
