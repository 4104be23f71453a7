"""From capture to files on the command line: what is written, said, and refused with status 2."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import matplotlib.image
import numpy as np
import pytest
import scipy.io
from scipy.constants import c
from scipy.linalg import hadamard

from hdf5files import changed
from reconstruction import (
    Capture,
    InputError,
    first_patterns,
    make_plan,
    read_capture,
    read_result,
    reconstruct,
    write_capture,
    write_outputs,
)
from reconstruction.base.files import mark
from reconstruction.capture import Buckets, Optics, Provenance
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.cli import main
from reconstruction.operators import expose
from reconstruction.outputs import pictures
from reconstruction.outputs.pictures import rendered_text
from reconstruction.outputs.result_file import result_bytes
from reconstruction.ranging import RANGING_METHODS, Alternative, Ranges

CAR = Path(__file__).parents[1] / "data" / "car_buckets_201.npy"
SHAPE = (16, 32)
SPOT_RANGES = np.array([2.0, 3.0, 4.0, 5.0])


def make_image():
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return 1e4 * (1.5 + np.sin(x / 5) * np.cos(y / 4))


@pytest.fixture
def capture():
    """Noise-free capture of two frames, the second twice as bright, 60 % of the patterns."""
    plan = make_plan(SHAPE, 307)
    light = expose(plan, np.stack([make_image(), 2 * make_image()])) + 1e6
    directions = np.array([[-0.1, -0.05, 1], [0.1, -0.05, 1], [-0.1, 0.05, 1], [0.1, 0.05, 1]])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    phase = 2 * np.pi * 15e6 * 2 * SPOT_RANGES / c
    taps = 1e5 + 2e4 * np.cos(phase[:, None] - np.arange(4) * np.pi / 2)
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=light / 100 + 20,
            saturated=np.zeros(light.shape, dtype=bool),
            exposure_time_s=60e-6,
            pattern_period_s=67e-6,
            electrons_per_count=100.0,
            offset_counts=20.0,
            noise_electrons=np.nan,
            excess_noise_factor=1.0,
            dead_time_s=0.0,
        ),
        spots=CwSpots(
            taps=np.stack([taps, taps]),
            saturated=np.zeros((2, 4, 4), dtype=bool),
            directions=directions,
            detector_positions_m=np.zeros((4, 3)),
            clear_probability=1.0,
            tap_frequencies_hz=np.full(4, 15e6),
            tap_phases_rad=np.arange(4) * np.pi / 2,
            phase_offsets_rad=np.zeros(4),
            periods=1000,
            electrons_per_count=1.0,
            offset_counts=0.0,
            noise_electrons=np.zeros(4),
            excess_noise_factor=1.0,
        ),
        optics=Optics(0.2, 0.1),
        provenance=Provenance("simulation", "test", "2025-01-01T00:00:00+00:00", ""),
    )


@pytest.fixture
def path(capture, tmp_path):
    write_capture(capture, tmp_path / "capture.h5")
    return tmp_path / "capture.h5"


def test_reconstruct_gives_electrons_per_pixel_and_ranges(capture):
    result = reconstruct(capture)
    assert result.image.dtype == np.float32
    assert np.corrcoef(result.image.ravel(), make_image().ravel())[0, 1] > 0.99
    assert result.image.mean() == pytest.approx(make_image().mean(), rel=1e-5)
    assert np.allclose(result.ranges.range_m, SPOT_RANGES)
    ratio = result.range_m / result.depth_m
    assert ratio[0, 0] == pytest.approx(np.sqrt(1 + 0.19375**2 + 0.09375**2), rel=1e-5)
    assert reconstruct(capture, 1).image.mean() == pytest.approx(2 * make_image().mean(), rel=1e-5)


def test_nearest_baseline_takes_the_spots_ranges(capture):
    result = reconstruct(capture)
    ranges = result.depths["nearest"] * result.range_over_depth
    assert np.allclose(np.unique(ranges.round(4)), SPOT_RANGES)


def test_saturated_readings_are_left_out(capture):
    counts = capture.buckets.counts.copy()
    saturated = np.zeros(counts.shape, dtype=bool)
    counts[0, 41], saturated[0, 41] = 1e9, True
    outliers = replace(
        capture, buckets=replace(capture.buckets, counts=counts, saturated=saturated)
    )
    image = reconstruct(outliers).image
    assert np.corrcoef(image.ravel(), make_image().ravel())[0, 1] > 0.99
    saturated[:] = True
    with pytest.raises(
        InputError,
        match="no image, because every pattern has a saturated reading; record again",
    ):
        reconstruct(outliers)


def test_without_a_valid_spot_there_is_no_map(capture):
    saturated = np.ones((2, 4, 4), dtype=bool)
    result = reconstruct(replace(capture, spots=replace(capture.spots, saturated=saturated)))
    assert not result.ranges.valid.any()
    assert result.depth_m is result.range_m is None
    assert not result.depths
    assert result.obstacle_m is None or result.obstacle_m < 1


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_fewer_patterns_is_what_fewer_patterns_would_have_given(capture, polarity):
    def recorded(patterns):
        plan = make_plan(SHAPE, patterns, polarity=polarity)
        buckets = replace(
            capture.buckets,
            counts=expose(plan, make_image())[None] / 100 + 20 * (polarity != "signed"),
            saturated=np.zeros((1, plan.exposures), dtype=bool),
            offset_counts=20.0 * (polarity != "signed"),
        )
        return replace(capture, plan=plan, buckets=buckets, spots=None)

    few = first_patterns(recorded(200), 50)
    assert few.plan.sampled == 50
    assert np.allclose(reconstruct(few).image, reconstruct(recorded(50)).image, rtol=1e-4)
    with pytest.raises(InputError, match=r"patterns = 201; allowed in this capture: 1\.\.200"):
        first_patterns(recorded(200), 201)


def test_command_writes_every_file_and_the_result_reads_back(path, tmp_path, capsys):
    assert main([str(path), "-o", str(tmp_path / "out")]) == 0
    pictures = {"image.png", "image_pursuit.png", "image_zero_filled.png"}
    pictures |= {"depth.png", "depth_nearest.png", "depth-deviation.png"}
    names = pictures | {"cloud.ply", "result.h5"}
    assert {file.name for file in (tmp_path / "out").iterdir()} == names
    for name in ("image.png", "depth.png"):
        assert matplotlib.image.imread(tmp_path / "out" / name).std() > 0.05
    result, copy = reconstruct(read_capture(path)), read_result(tmp_path / "out" / "result.h5")
    for group in ("images", "depths"):
        outcome, expected = getattr(copy, group), getattr(result, group)
        assert list(outcome) == list(expected)  # the default method first
        assert all(np.array_equal(outcome[name], expected[name]) for name in expected)
    assert np.array_equal(copy.range_m, result.range_m)
    assert list(copy.rangings) == ["cw"]
    assert np.array_equal(copy.ranges.valid, result.ranges.valid)
    assert copy.ranges.status == result.ranges.status
    assert copy.timings_s.keys() == result.timings_s.keys()
    for name in ("unit", "recording", "frame", "patterns"):
        assert getattr(copy, name) == getattr(result, name)
    out = capsys.readouterr().out
    assert "307 patterns (60.0 %)" in out
    assert "3.000" in out


def test_methods_are_chosen_and_pictures_of_others_do_not_stay(path, tmp_path, capsys):
    def run(*options):
        assert main([str(path), "-o", str(tmp_path / "out"), "--json", *options]) == 0
        report = json.loads(capsys.readouterr().out)
        return report, {file.name for file in (tmp_path / "out").iterdir()}

    report, files = run("--image", "zero-filled,pursuit:dct", "--depth", "nearest,anchored")
    assert report["images"] == ["zero-filled", "pursuit:dct"]
    assert list(report["depth_coverage"]) == ["nearest", "anchored"]
    default = {"image.png", "depth.png", "cloud.ply", "result.h5"}
    anchored = {"depth_anchored.png", "depth-deviation_anchored.png"}
    assert files == default | anchored | {"image_pursuit_dct.png"}
    result = read_result(tmp_path / "out" / "result.h5")
    assert list(result.images) == ["zero-filled", "pursuit:dct"]
    report, files = run("--image", "pursuit", "--depth", "nearest", "--ranging", "all")
    assert list(report["spots"]) == ["cw"]
    assert files == default | {"image_zero_filled.png"}


def test_json_is_one_object(path, tmp_path, capsys):
    arguments = [
        "reconstruct",
        str(path),
        "-o",
        str(tmp_path / "out"),
        "--json",
        "--patterns",
        "50",
    ]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["patterns"] == 50
    assert report["spots"]["cw"][3]["range_m"] == pytest.approx(5.0)
    assert Path(report["files"]["depth.png"]).is_file()


def test_without_time_of_flight_there_is_an_image_only_and_it_says_so(tmp_path, capsys):
    vectors = hadamard(1024)
    readings = np.load(CAR).reshape(1, -1)
    scipy.io.savemat(tmp_path / "car.mat", {"data": readings, "vecs": vectors.astype(np.int8)})
    imported = [
        *("import", str(tmp_path / "car.mat"), "-o", str(tmp_path / "car.h5"), "--shape", "32x32"),
        *("--variable", "data", "--patterns-variable", "vecs", "--untrusted", "0"),
    ]
    out = tmp_path / "out"
    out.mkdir()
    (out / "depth.png").write_bytes(mark("depth").encode())
    (out / "image_edge_preserving.png").write_bytes(b"of someone else")
    assert main(imported) == 0
    assert main([str(tmp_path / "car.h5"), "-o", str(out)]) == 2
    assert "image_edge_preserving.png exists and is not an earlier image" in capsys.readouterr().err
    assert main([str(tmp_path / "car.h5"), "-o", str(out), "--overwrite"]) == 0
    assert "no time of flight" in capsys.readouterr().out
    assert not (out / "depth.png").exists()
    assert (out / "image.png").exists()
    assert (out / "image_edge_preserving.png").read_bytes() == b"of someone else"


def test_import_with_a_named_plan_is_the_same_as_with_the_patterns(tmp_path):
    np.save(tmp_path / "car.npy", np.load(CAR))
    arguments = ["import", str(tmp_path / "car.npy"), "-o", str(tmp_path / "car.h5")]
    assert main([*arguments, "--shape", "32x32"]) == 0
    plan = read_capture(tmp_path / "car.h5").plan
    assert np.array_equal(plan.index, np.arange(1024))
    assert (plan.polarity == 0).all()


def test_bad_input_ends_with_status_2_and_one_line(path, tmp_path, capsys):
    out = str(tmp_path / "out")
    (tmp_path / "text.h5").write_text("no capture")
    (tmp_path / "file").write_text("")
    readings = tmp_path / "readings.npy"
    np.save(readings, np.ones(63))
    rows, of_matrix = hadamard(64), tmp_path / "readings.npz"
    np.savez(of_matrix, short=np.ones(63), odd=np.ones((65, 2)), rows=rows)
    new = str(tmp_path / "new.h5")
    by_rows = ["import", str(of_matrix), "-o", new, "--shape", "8x8", "--patterns-variable", "rows"]
    for arguments, message in [
        ([str(tmp_path / "none.h5"), "-o", out], "no such capture file"),
        ([str(tmp_path / "text.h5"), "-o", out], "not an HDF5 file"),
        ([str(path), "-o", out, "--frame", "2"], "frames 0..1"),
        ([str(path), "-o", out, "--patterns", "0"], "patterns = 0"),
        ([str(path), "-o", out, "--patterns", "9", "--order", "natral"], "did you mean 'natural'"),
        ([str(path), "-o", out, "--image", "zero-fill"], "did you mean 'zero-filled'"),
        ([str(path), "-o", out, "--image", "zero-filled:dct"], "'zero-filled' uses no dictionary"),
        ([str(path), "-o", out, "--ranging", "dtof"], "reads 'dtof' spots, not those of 'cw'"),
        ([str(path), "-o", out, "--depth", "nearest,dense"], "'dense' needs pattern taps, which"),
        ([str(path), "-o", str(tmp_path / "file" / "x")], "file is not a folder"),
        ([str(path), "-o", str(tmp_path / "file")], "file is not a folder"),
        (["import", str(path), "-o", new, "--shape", "8x8"], "a capture is reconstructed as it"),
        (
            ["import", str(path), "-o", out, "--shape", "8x8"],
            "an ending is missing of this hardware capture",
        ),
        (["import", str(readings), "-o", new, "--shape", "8x8"], f"{readings}: the readings have"),
        ([*by_rows, "--variable", "short", "--shape", "7x8"], "expected (M, 56) for 7 x 8 pixels"),
        ([*by_rows, "--variable", "short"], "the readings have shape (63,)"),
        ([*by_rows, "--variable", "odd"], "the readings have shape (65, 2)"),
        ([str(tmp_path), "-o", out], "is a folder; the name of a capture file is needed"),
    ]:
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert error.startswith("error: ")
        assert message in error
        assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [[], ["capture.h5"], ["import", "a.npy", "--shape", "32"]])
def test_wrong_usage_ends_with_status_2(arguments):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2


AMBIGUOUS = Ranges(
    range_m=np.array([2.0, np.nan, np.nan, 4.0]),
    sigma_m=np.array([0.1, np.nan, np.nan, 0.1]),
    signal_electrons=np.ones(4),
    background_electrons=np.ones(4),
    status=("ok", "ambiguous", "weak", "ok"),
    alternatives=(
        (Alternative(2.0, 0.1, 0.95), Alternative(7.0, 0.2, 0.05)),
        (Alternative(2.314, 0.01, 0.7), Alternative(2.941, 0.02, 0.3)),
        (),
        (Alternative(4.0, 0.1, 1.0),),
    ),
)


def test_ranges_that_a_spot_may_have_come_back(capture, tmp_path):
    result = replace(reconstruct(capture), rangings={"cw": AMBIGUOUS})
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(result))
    assert read_result(path).ranges.alternatives == AMBIGUOUS.alternatives
    with changed(path) as content:
        del content["rangings/cw/alternatives"]
    copy = read_result(path).ranges
    assert copy.alternatives == ((), (), (), ())
    assert copy.status == AMBIGUOUS.status
    plain = replace(result, rangings={"cw": replace(AMBIGUOUS, alternatives=((),) * 4)})
    path.write_bytes(result_bytes(plain))
    assert read_result(path).ranges.alternatives == ((), (), (), ())


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("range_m", np.ones(4), r"alternatives/range_m has shape \(4,\)"),
        ("sigma_m", np.ones((4, 3)), r"alternatives/sigma_m has shape \(4, 3\), expected \(4, n"),
        ("weight", None, "alternatives/weight is missing"),
    ],
)
def test_wrong_alternatives_are_named(capture, tmp_path, name, value, message):
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(replace(reconstruct(capture), rangings={"cw": AMBIGUOUS})))
    with changed(path) as content:
        group = content["rangings/cw/alternatives"]
        units = group[name].attrs["units"]
        del group[name]
        if value is not None:
            group[name] = value
            group[name].attrs["units"] = units
    with pytest.raises(InputError, match=message):
        read_result(path)


def test_ranges_that_a_spot_may_have_are_printed(path, tmp_path, monkeypatch, capsys):
    class Unsure:
        title = "test"
        reads = CwSpots

        def compile(self, *_):
            return lambda *_: AMBIGUOUS

    monkeypatch.setitem(RANGING_METHODS._loaded, "unsure", Unsure())
    monkeypatch.setenv("COLUMNS", "120")
    arguments = [str(path), "-o", str(tmp_path / "out"), "--ranging", "unsure"]
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    (row,) = (line for line in lines if line.startswith("spot 1"))
    assert "ambiguous: 2.31 m (70 %), 2.94 m (30 %)" in row
    (row,) = (line for line in lines if line.startswith("spot 0"))
    assert "%" not in row
    assert main([*arguments, "--json"]) == 0
    spots = json.loads(capsys.readouterr().out)["spots"]["unsure"]
    assert spots[1]["alternatives"] == [
        {"range_m": 2.314, "sigma_m": 0.01, "weight": 0.7},
        {"range_m": 2.941, "sigma_m": 0.02, "weight": 0.3},
    ]
    assert spots[2]["alternatives"] == []


def test_the_probability_of_obstacles_is_an_option(path, tmp_path, capsys):
    arguments = [str(path), "-o", str(tmp_path / "out"), "--depth", "anchored", "--json"]
    reported = []
    for min_free in ("0.95", "0.3"):
        assert main([*arguments, "--min-free", min_free]) == 0
        reported.append(json.loads(capsys.readouterr().out.splitlines()[-1]))
        assert read_result(tmp_path / "out/result.h5").min_free == float(min_free)
    near, far = reported
    assert near["obstacles_m"]["anchored"] < far["obstacles_m"]["anchored"]
    assert near["free_probabilities"] == far["free_probabilities"]
    assert len(near["free_distance_m"]) == len(near["free_probabilities"]["anchored"])
    assert main([*arguments, "--min-free", "1.5"]) == 2
    assert "min_free = 1.5: must lie between 0 and 1, exclusive" in capsys.readouterr().err


def test_a_result_of_some_patterns_is_still_one_of_the_recording(capture, path, tmp_path):
    assert main([str(path), "-o", str(tmp_path / "out"), "--patterns", "50", "--frame", "1"]) == 0
    result = read_result(tmp_path / "out" / "result.h5")
    assert result.recording == capture.frame(1).digest(capture.setup)
    assert (result.patterns, result.frame) == (50, 1)


def test_warnings_go_to_stderr_and_into_the_json(capture, tmp_path, capsys):
    capture.buckets.saturated[0, 41] = True
    write_capture(capture, tmp_path / "capture.h5")
    assert main([str(tmp_path / "capture.h5"), "-o", str(tmp_path / "out"), "--json"]) == 0
    out, err = capsys.readouterr()
    (warning,) = json.loads(out)["warnings"]
    assert err == f"warning: {warning}\n"
    assert "1 of 614 bucket readings (0.163 %) are marked saturated" in warning


def test_a_capture_without_a_usable_pattern_is_named(capture, tmp_path, capsys):
    capture.buckets.saturated[:] = True
    write_capture(capture, tmp_path / "bright.h5")
    assert main([str(tmp_path / "bright.h5"), "-o", str(tmp_path / "out")]) == 2
    assert (
        f"{tmp_path / 'bright.h5'}: frame 0: no image, because every pattern"
        in capsys.readouterr().err
    )
    assert not (tmp_path / "out").exists()


@pytest.fixture
def texts(monkeypatch):
    """Whatever is written into pictures."""
    drawn = []

    def noted(text):
        drawn.append(text)
        return rendered_text(text)

    monkeypatch.setattr(pictures, "rendered_text", noted)
    return drawn


def test_pictures_of_unscaled_counts_do_not_speak_of_electrons(capture, tmp_path, texts):
    unscaled = replace(capture, buckets=replace(capture.buckets, electrons_per_count=np.nan))
    write_outputs(reconstruct(unscaled), unscaled, tmp_path)
    assert sum(text.startswith("counts per exposure") for text in texts) == 3
    with h5py.File(tmp_path / "result.h5") as file:
        assert file["images/pursuit"].attrs["units"] == b"count"


def test_the_depth_picture_tells_the_depth_of_the_spots(capture, tmp_path, texts):
    capture.spots.saturated[0, 3] = True
    write_outputs(reconstruct(capture), capture, tmp_path)
    depth = SPOT_RANGES * capture.spots.directions[:, 2]
    labels = [*(f"{metres:.2f} m" for metres in depth[:3]), "saturated"]
    assert [text for text in texts if text in labels] == labels * 2  # in the picture of each map


def test_module_runs_without_the_simulator(path, tmp_path):
    code = (
        "import sys; from reconstruction.cli import main; "
        f"status = main([{str(path)!r}, '-o', {str(tmp_path / 'out')!r}]); "
        "banned = {'spisim', 'mitsuba', 'drjit', 'trimesh', 'pydantic', 'yaml', 'typer'}; "
        "sys.exit(status or sorted(banned & set(sys.modules)) or None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    done = subprocess.run(
        [sys.executable, "-m", "reconstruction", "--help"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0
    assert "import" in done.stdout
