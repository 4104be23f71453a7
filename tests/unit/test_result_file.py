"""Result files: what is written comes back, and what is wrong with one is named."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from damage import refusals
from hdf5files import changed
from reconstruction import (
    Capture,
    InputError,
    Reconstructor,
    read_result,
    reconstruct,
    write_capture,
)
from reconstruction.depth import DISTANCES_M
from reconstruction.exports.results import _optics
from reconstruction.outputs import write_outputs
from reconstruction.outputs.result_file import result_bytes

SHAPE = (16, 16)


def test_a_result_of_one_image_alone_is_read_back(capture: Capture, tmp_path: Path) -> None:
    result = Reconstructor(capture.setup, image="zero-filled", ranging=(), depth=())(
        capture.frame()
    )
    write_outputs(result, capture, tmp_path / "out")
    outcome = read_result(tmp_path / "out" / "result.h5")
    assert list(outcome.images) == ["zero-filled"]
    np.testing.assert_array_equal(outcome.image, result.image)


@pytest.mark.parametrize(
    ("shape", "expected"), [((6, 8), (0.2, 0.1)), ((1, 8), (0.2, 0.2)), ((6, 1), (0.1, 0.1))]
)
def test_optics_of_a_result_are_those_of_its_rays(
    shape: tuple[int, int], expected: tuple[float, float]
) -> None:
    """Rays of lengths √(1 + x² + y²); one row or column of pixels states the other side, too."""
    down, across = (
        tangent * (2 * np.arange(count) + 1 - count) / count
        for tangent, count in zip((0.1, 0.2), shape, strict=True)
    )
    lengths = np.sqrt(1 + across**2 + down[:, None] ** 2)
    result = _optics(SimpleNamespace(range_over_depth=lengths))
    assert result is not None
    assert (result.tan_half_width, result.tan_half_height) == pytest.approx(expected)


@pytest.fixture
def result_file(capture, tmp_path):
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(reconstruct(capture)))
    return path


def test_a_full_disk_leaves_nothing_half_written(capture, tmp_path, monkeypatch):
    def no_space(_):
        raise OSError(28, "No space left on device")

    result = reconstruct(capture)
    monkeypatch.setattr("os.fsync", no_space)
    with pytest.raises(OSError, match="No space left"):
        write_outputs(result, capture, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_depth_map_of_truth_values_is_none(capture, tmp_path):
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(reconstruct(capture)))
    (method,) = list(read_result(path).depths)[:1]
    with changed(path) as file:
        near = file[f"depths/{method}"][()] > 3
        del file[f"depths/{method}"]
        file[f"depths/{method}"] = near
        file[f"depths/{method}"].attrs["units"] = "m"
    with pytest.raises(InputError, match=rf"depths/{method} must hold numbers, found bool"):
        read_result(path)


def test_a_foreign_file_is_no_result(capture, tmp_path):
    path = tmp_path / "capture.h5"
    write_capture(capture, path)
    with pytest.raises(InputError, match=r"not a result \(attribute 'format' is 'spisim-capture'"):
        read_result(path)
    with pytest.raises(InputError, match=r"none\.h5: no such result; run spisim reconstruct"):
        read_result(tmp_path / "none.h5")


def test_a_damaged_result_is_told(result_file):
    messages = refusals(result_file, read_result, InputError)
    assert len(messages) > 5
    assert all(message.startswith(f"{result_file}: ") for message in messages)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("images/pursuit", None, "images/pursuit is missing"),
        ("rangings/cw/status", None, "dataset rangings/cw/status is missing"),
        ("rangings/cw/status", np.array([b"ok", b"ok", b"ok", b"fine"]), "'fine'"),
        ("images/zero-filled", np.zeros((4, 4)), r"images/zero-filled has shape \(4, 4\)"),
        ("images/zero-filled", np.full(SHAPE, b"x"), "images/zero-filled must hold numbers"),
        ("rangings/cw/range_m", np.zeros(3), r"rangings/cw/range_m has shape \(3,\)"),
        ("rangings/cw/nothing", np.zeros(3), r"rangings/cw/nothing has shape \(3,\)"),
        ("frame", 0.5, "frame is 0.5, must be an integer"),
        ("timings_s/decoding", b"x", "timings_s/decoding must hold numbers"),
    ],
)
def test_a_wrong_part_of_a_result_is_named(result_file, name, value, message):
    with changed(result_file) as content:
        units = content[name].attrs["units"]
        del content[name]
        if value is not None:
            content[name] = value
            content[name].attrs["units"] = units
    with pytest.raises(InputError, match=message):
        read_result(result_file)


def far_from(obstacle_m):
    return np.where(obstacle_m > DISTANCES_M, 0.9, 0.1)


def test_a_corridor_without_a_map_and_what_shows_no_target_come_back(capture, tmp_path):
    result = reconstruct(capture, depth="nearest")
    nothing = np.array([0.1, np.nan, 0.0, 1.0])
    ranges = replace(result.ranges, nothing=nothing)
    unmapped = replace(
        result,
        rangings={"cw": ranges},
        depths={},
        free_probabilities={"nearest": far_from(2.5)},
    )
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(unmapped))
    copy = read_result(path)
    np.testing.assert_array_equal(copy.ranges.nothing, nothing)
    assert copy.depths == {}
    assert copy.obstacle_m == unmapped.obstacle_m


def test_what_is_known_of_depths_is_shown_and_comes_back(capture, tmp_path):
    sigma = np.full(SHAPE, 0.2, np.float32)
    sigma[0] = np.nan
    no_return = np.where(np.isnan(sigma), 0.9, 0.1).astype(np.float32)
    result = replace(
        reconstruct(capture),
        log_depth_sigmas={"nearest": sigma},
        no_returns={"anchored": no_return, "nearest": no_return},
        free_probabilities={"anchored": far_from(2.5), "nearest": np.ones(DISTANCES_M.size)},
        min_free=0.8,
        notes={"depth anchored": "a guess"},
    )
    files = write_outputs(result, capture, tmp_path)
    assert {"depth-deviation_nearest.png", "nothing.png", "nothing_nearest.png"} <= files.keys()
    copy = read_result(tmp_path / "result.h5")
    assert copy.no_returns.keys() == {"anchored", "nearest"}
    assert copy.min_free == 0.8
    assert copy.obstacle_m == pytest.approx(2.5, rel=0.1)
    np.testing.assert_array_equal(copy.free_probability, far_from(2.5))
    assert np.isnan(copy.obstacles_m["nearest"])
    assert copy.notes == result.notes
    assert copy.warnings == ["depth 'anchored' is a guess"]
    np.testing.assert_array_equal(copy.log_depth_sigmas["nearest"], sigma)
    np.testing.assert_array_equal(copy.no_return, no_return)
    assert copy.log_depth_sigma is None
    again = write_outputs(reconstruct(capture), capture, tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == again.keys()  # the others are gone
