"""Arrays of a data set by name: what they are, as the table of the docs tells."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spisim
from captures import with_spots
from datasets import make_set
from pages import ROOT
from reconstruction import Capture, InputError, reconstruct, write_capture
from spisim.dataset import DataSet
from spisim.dataset.fields import FIELDS

SCENE = """
name: wall
drone: {position_m: [1, 2, 3], look_at_m: [1, 12, 3]}
objects: [{name: board, shape: rectangle, size_m: [1, 1], material: paint-white}]
"""
SIZES = {
    "frame": 1,
    "exposure": 256,
    "row": 16,
    "column": 16,
    "spot": 4,
    "tap": 4,
    "axis": 3,
    "pixel": 3,
    "ray": 3,
    "world": 4,
    "camera": 4,
}


@pytest.fixture(scope="module")
def data(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> DataSet:
    folder = make_set(tmp_path_factory.mktemp("sets") / "walls", capture, done=2, failed=0)
    placed = replace(capture, provenance=replace(capture.provenance, scene=SCENE))
    write_capture(placed, folder / "samples/000/000000.h5")
    return spisim.open_dataset(folder)


@pytest.mark.parametrize("name", sorted(FIELDS.keys() - {"image", "depth_m"}))
def test_every_array_is_as_told(data: DataSet, name: str) -> None:
    field, values = FIELDS[name], data[0].array(name)
    assert values.dtype == field.dtype
    assert values.shape == tuple(SIZES[axis] for axis in field.dims)


def test_the_docs_tell_of_every_array() -> None:
    page = (ROOT / "docs" / "reference" / "dataset-arrays.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \| (\w+) \| ([^|]+) \| ", page, re.MULTILINE)
    assert {name: tuple(reported) for name, *reported in rows} == {
        name: (", ".join(field.dims), field.dtype, field.units) for name, field in FIELDS.items()
    }


def test_images_and_depth_maps_are_those_of_the_method_named(
    data: DataSet, capture: Capture
) -> None:
    by_default, plain = reconstruct(capture), reconstruct(capture, depth="nearest")
    arrays = data[:1].arrays("image", "image.zero-filled", "depth_m", "depth_m.nearest")
    assert arrays["image"].dtype == arrays["depth_m"].dtype == np.float32
    np.testing.assert_array_equal(arrays["image"][0, 0], by_default.image)
    np.testing.assert_array_equal(
        arrays["image.zero-filled"][0, 0], by_default.images["zero-filled"]
    )
    np.testing.assert_array_equal(arrays["depth_m"][0, 0], by_default.depth_m)
    np.testing.assert_array_equal(arrays["depth_m.nearest"][0, 0], plain.depth_m)
    assert not np.array_equal(arrays["depth_m"], arrays["depth_m.nearest"])
    with pytest.raises(InputError, match=r"depth method 'anchord': did you mean 'anchored'"):
        data.arrays("depth_m.anchord")
    with pytest.raises(InputError, match=r"no array or numeric parameter 'pose.anchored'"):
        data.arrays("pose.anchored")


def test_spots_meet_the_scene_where_pose_and_intrinsics_say(data: DataSet) -> None:
    """The camera at (1, 2, 3) looks along y; what is right of it lies along x."""
    sample = data[0]
    pose, to_pixels = sample.array("pose")[0], sample.array("intrinsics")
    np.testing.assert_allclose(pose @ [0, 0, 5, 1], [1, 7, 3, 1], atol=1e-12)
    np.testing.assert_allclose(pose @ [2, 0, 0, 1], [3, 2, 3, 1], atol=1e-12)
    np.testing.assert_allclose(pose @ [0, 2, 0, 1], [1, 2, 1, 1], atol=1e-12)
    edge = to_pixels @ [0.1, -0.1, 1]  # tangents of the half angles to the outer edges
    np.testing.assert_allclose(edge, [15.5, -0.5, 1])
    at = sample.array("spot_directions") * sample.array("true_spot_range_m")[0][:, None]
    np.testing.assert_allclose((to_pixels @ at[3])[:2] / at[3, 2], 11.5)


def test_samples_may_have_nine_spots(own: Path, capture: Capture) -> None:
    nine = with_spots(capture, [0, 1, 2, 3, 0, 1, 2, 3, 0])
    write_capture(nine, own / "samples/000/000000.h5")
    sample = spisim.open_dataset(own)[0]
    assert {sample.array(f"spot_{name}").shape for name in ("range_m", "sigma_m")} == {(1, 9)}
    assert sample.array("spot_readings").shape == (1, 9, 4)
    np.testing.assert_array_equal(sample.array("true_spot_range_m"), nine.truth.spot_range_m)


def test_masks_tell_where_numbers_are(own: Path, capture: Capture) -> None:
    assert capture.truth is not None
    depth_m = np.where(np.arange(16) < 3, np.nan, capture.truth.depth_m).astype(np.float32)
    sky = replace(capture, truth=replace(capture.truth, depth_m=depth_m), spots=None)
    write_capture(sky, own / "samples/000/000000.h5")
    sample = spisim.open_dataset(own)[0]
    np.testing.assert_array_equal(sample.array("true_depth_known")[0, 5], np.arange(16) >= 3)
    with pytest.raises(InputError, match=r"000000\.h5: the capture has no spot_known"):
        sample.array("spot_known")


@pytest.fixture
def own(capture: Capture, tmp_path: Path) -> Path:
    return make_set(tmp_path / "own", capture, done=12, failed=0)


PLAN = """
name: flights
samples: 12
scenes: [{family: targets}]
vary: {instrument.lasers.power_w: {grid: [0.001, 0.002]}}
poses: {count: 3, flight_s: 2, offset_m: [1, 0, 0]}
"""


def test_the_samples_of_a_flight_come_in_order(own: Path) -> None:
    (own / "plan.yaml").write_text(PLAN)
    data = spisim.open_dataset(own)
    sequences = [[sample.index for sample in part] for part in data.sequences()]
    assert sequences == [[0, 2, 4], [1, 3, 5], [6, 8, 10], [7, 9, 11]]
    chosen = data.select([2, 4, 7]).sequences()
    assert [[sample.index for sample in part] for part in chosen] == [[2, 4], [7]]
    (own / "plan.yaml").write_text(PLAN.replace("poses", "#"))
    with pytest.raises(InputError, match="the plan has no `poses`"):
        spisim.open_dataset(own).sequences()
