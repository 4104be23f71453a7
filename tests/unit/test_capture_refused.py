"""Capture files that are broken, foreign, newer or impossible are refused by name."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from captures import full_capture, make_spots
from damage import refusals
from hdf5files import changed
from reconstruction.base.errors import InputError
from reconstruction.capture import read_capture, write_capture
from reconstruction.operators import make_plan


@pytest.fixture
def capture():
    return full_capture()


@pytest.fixture
def path(capture, tmp_path):
    write_capture(capture, tmp_path / "capture.h5")
    return tmp_path / "capture.h5"


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.h5: no such capture file"):
        read_capture(tmp_path / "none.h5")


@pytest.mark.parametrize("length", [0, 100, 3000, -1])
def test_truncated_files_are_refused(path, length):
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(InputError, match=r"capture\.h5: .*truncated.* damaged"):
        read_capture(path)


def test_other_hdf5_is_refused(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["data"] = 1
        file.attrs["version"] = "2.0"
    with pytest.raises(InputError, match=r"but not a capture \(attribute 'format' is missing\)"):
        read_capture(tmp_path / "other.h5")
    with h5py.File(tmp_path / "other.h5", "r+") as file:
        file.attrs["format"] = "nexus"
    with pytest.raises(InputError, match=r"not a capture \(attribute 'format' is 'nexus', not"):
        read_capture(tmp_path / "other.h5")


def test_damaged_files_are_read_or_refused_but_never_anything_else(path):
    messages = refusals(path, read_capture, InputError)
    assert len(messages) > 20
    assert all(message.startswith(f"{path}: ") for message in messages)


@pytest.mark.parametrize(
    "error", [KeyError("x"), ValueError, TypeError, UnicodeDecodeError("utf-8", b"", 0, 1, "bad")]
)
def test_what_damage_raises_is_an_input_error(path, monkeypatch, error):
    def broken(*_):
        raise error

    monkeypatch.setattr("h5py.Dataset.__getitem__", broken)
    with pytest.raises(InputError, match=r"capture\.h5: .*damaged"):
        read_capture(path)


def test_a_text_that_is_not_utf_8_is_damage(path):
    with changed(path) as file:
        del file["patterns/basis"]
        file["patterns/basis"] = np.bytes_(b"\xff\xfe")
        file["patterns/basis"].attrs["units"] = "1"
    with pytest.raises(InputError, match=r"damaged .*utf-8"):
        read_capture(path)


@pytest.mark.parametrize("version", ["4.2", "5.0", "10.0"])
def test_newer_versions_are_refused_naming_both(path, version):
    with changed(path) as file:
        file.attrs["version"] = version
    with pytest.raises(InputError, match=rf"newer format version {version}.*reads up to 4\.1"):
        read_capture(path)


@pytest.mark.parametrize("version", ["0.9", "1.0", "1.7"])
def test_older_versions_are_refused_naming_both(path, version):
    with changed(path) as file:
        file.attrs["version"] = version
    with pytest.raises(InputError, match=rf"older format version {version}.*reads 2\.0 to 4\.1"):
        read_capture(path)


@pytest.mark.parametrize("version", ["one", "1", "1.0.0"])
def test_malformed_versions_are_refused(path, version):
    with changed(path) as file:
        file.attrs["version"] = version
    with pytest.raises(InputError, match="not of the form"):
        read_capture(path)


@pytest.mark.parametrize(
    "name",
    ["patterns/index", "patterns/basis", "buckets/counts", "spots/taps", "provenance/scene"],
)
def test_a_missing_dataset_is_named(path, name):
    with changed(path) as file:
        del file[name]
    with pytest.raises(InputError, match=f"dataset {name} is missing"):
        read_capture(path)


def replace_dataset(path, name, value, units=None):
    with changed(path) as file:
        retained = file[name].attrs["units"]
        del file[name]
        file[name] = value
        file[name].attrs["units"] = retained if units is None else units


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("buckets/counts", np.zeros((2, 19)), r"shape \(2, 19\).*frames = 2, exposures = 20"),
        ("buckets/counts", np.full((2, 20), np.nan), "not finite"),
        ("buckets/counts", np.full((2, 20), b"text"), "must hold numbers"),
        ("buckets/exposure_time_s", 0.0, "must be positive"),
        ("buckets/offset_counts", np.zeros(2), "expected .a scalar"),
        ("spots/taps", np.zeros((1, 4, 3)), r"shape \(1, 4, 3\), expected \(frames = 2"),
        ("spots/directions", np.ones((3, 2)), r"shape \(3, 2\), expected \(spots = 3, 3 = 3\)"),
        ("spots/directions", np.tile([0, 0, 57.0], (4, 1)), "unit vectors"),
        ("spots/tap_frequencies_hz", np.full(3, -1.0), "must be positive"),
        ("spots/tap_frequencies_hz", [1e6, 1e6, 2e6], "1e.06 Hz has 2 tap.* at least 3"),
        ("spots/tap_frequencies_hz", 15e6, r"shape \(\), expected \(taps = 3\)"),
        ("spots/phase_offsets_rad", 0.1, r"shape \(\), expected \(taps = 3\)"),
        ("spots/periods", [1000, 1000], r"shape \(2,\), expected \(taps = 3\)"),
        ("spots/laser_energies_j", 0.0, "must be positive"),
        ("spots/detector_axes", np.tile([0, 0, 57.0], (4, 1)), "unit vectors, or nan"),
        ("spots/half_fields_rad", [0.1, np.nan, 30.0, 0.1], "half_fields_rad is 30.*at most pi/2"),
        ("spots/aperture_radii_m", [0.1, np.nan, -1.0, 0.1], "must be not negative"),
        ("spots/tap_phases_rad", [0, 1, 1 + 2 * np.pi], "fewer than 3 different phases"),
        (
            "spots/method",
            "pulse",
            "spots/method: .*did you mean 'pulsed'. allowed: cw, dtof, pulsed",
        ),
        ("buckets/dead_time_s", -1e-9, "must be not negative"),
        ("buckets/excess_noise_factor", 0.0, "must be positive"),
        ("buckets/exposure_time_s", np.nan, "requires buckets/exposure_time_s, not nan"),
        ("buckets/electrons_per_count", np.nan, "requires buckets/electrons_per_count, not nan"),
        ("pattern_taps/taps", np.zeros((2, 19, 6)), r"exposures = 20, pattern taps = 6"),
        ("pattern_taps/tap_frequencies_hz", np.arange(1.0, 7), "at least 3"),
        ("truth/depth_m", np.zeros((2, 8, 4)), "truths = 2, height = 4, width = 8"),
        ("truth/depth_m", np.zeros((1, 4, 8)), "truths = 2, height = 4, width = 8"),
        ("buckets/electrons_per_count", np.inf, "electrons_per_count holds infinite values"),
        ("buckets/noise_electrons", -np.inf, "noise_electrons holds infinite values"),
        ("truth/depth_m", np.full((2, 4, 8), -1.0), "depth_m is -1.0, must be not negative"),
        ("truth/range_m", np.full((2, 4, 8), -1.0), "range_m is -1.0, must be not negative"),
        ("truth/spot_range_m", np.full((2, 4), -1.0), "spot_range_m is -1.0, must be not negative"),
        ("provenance/seed", b"x", "provenance/seed must hold numbers"),
        ("provenance/seed", np.nan, "provenance/seed is nan, must be an integer"),
        ("patterns/index", np.full(20, b"0"), "patterns/index must hold numbers"),
        ("patterns/polarity", np.full(20, b"1"), "patterns/polarity must hold numbers"),
        ("patterns/index", np.full(20, 32), r"outside 0\.\.31"),
        ("patterns/shape", np.array([4, 8, 1]), r"patterns/shape is \[4, 8, 1\], expected 2 int"),
        ("patterns/shape", np.array([4, 8.5]), r"patterns/shape is \[4.0, 8.5\], expected 2 int"),
        ("patterns/shape", np.array([4, np.inf]), r"patterns/shape is \[4.0, inf\]"),
        ("patterns/shape", np.array([4, 7]), "powers of two"),
        ("patterns/basis", "wavelet", "'wavelet': allowed: dense, fourier, fourier-binary"),
    ],
)
def test_a_wrong_dataset_is_named(path, name, value, message):
    replace_dataset(path, name, value)
    with pytest.raises(InputError, match=message) as error:
        read_capture(path)
    assert str(error.value).startswith(str(path))
    assert name.split("/")[1] in str(error.value) or "pattern" in str(error.value)
    assert str(error.value).count(str(path)) == 1


def windows(starts_s):
    """Readings in windows that start then."""
    number = len(starts_s)
    return {
        "window_starts_s": np.array(starts_s),
        "taps": np.zeros((2, 4, number)),
        "saturated": np.zeros((2, 4, number), bool),
    }


@pytest.mark.parametrize(
    ("method", "changes", "message"),
    [
        (
            "pulsed",
            {"taps": np.zeros((2, 4, 4))},
            r"spots/(taps|saturated|window_starts_s) has shape",
        ),
        (
            "pulsed",
            {"window_starts_s": np.array([-70e-9, 0, 60e-9])},
            "window 2 must start where the one before ends",
        ),
        ("pulsed", windows([-70e-9, 0]), "has 2 windows; .* at least two"),
        ("pulsed", windows([-70e-9, 0, 65e-9, 140e-9]), "window 3 must start .* 2 pulse_width_s"),
        ("pulsed", windows([65e-9, 0, 65e-9, 130e-9]), "background window overlaps"),
        ("pulsed", {"laser_energy_j": -1.0}, "spots/laser_energy_j is -1.0, must be positive"),
        ("pulsed", {"window_starts_s": np.array([64e-9, 0, 65e-9])}, "background window overlaps"),
        ("pulsed", {"pulse_width_s": 0.0}, "spots/pulse_width_s is 0.0, must be positive"),
        ("dtof", {"counts": np.zeros((2, 4, 2))}, "spots/counts has 2 bins.*at least 3"),
        ("dtof", {"counts": np.full((2, 4, 50), 201)}, "10050 arrivals.*pulses = 10000 cycles"),
        ("dtof", {"counts": np.full((2, 4, 50), -1)}, "spots/counts is -1, must be not negative"),
        ("dtof", {"saturated": np.zeros((2, 4, 50), bool)}, "spots/saturated has shape"),
        ("dtof", {"response_sigma_s": 0.0}, "spots/response_sigma_s is 0.0, must be positive"),
        ("dtof", {"bin_width_s": 1e-300}, r"spots/bin_width_s is 1e-300, must be at least 1e-18 s"),
        ("cw", {"tap_frequencies_hz": np.full(3, 1e12)}, r"hz is 1e\+12, must be within ±1e\+10"),
        ("cw", {"tap_frequencies_hz": np.full(3, 1e-300)}, "must be at least 0.001 Hz"),
        ("cw", {"noise_electrons": 1e300}, r"spots/noise_electrons is 1e\+300, must be within"),
    ],
)
def test_readings_that_cannot_be_are_refused(capture, method, changes, message):
    with pytest.raises(InputError, match=message):
        replace(capture, spots=replace(make_spots(method), **changes))


@pytest.mark.parametrize(
    "starts_s", [(-65e-9, 0, 65e-9), (130e-9, 0, 65e-9), (0, 65e-9, 130e-9, 195e-9)]
)
def test_the_background_window_may_touch_the_others(capture, starts_s):
    spots = replace(make_spots("pulsed"), **windows(starts_s))
    assert replace(capture, spots=spots).spots is spots


def test_dead_time_needs_counted_readings(capture):
    plan = replace(capture.plan, polarity=np.zeros(20, dtype=np.int8))
    with pytest.raises(
        InputError, match=r"differences \(patterns/polarity 0\) cannot be corrected"
    ):
        replace(capture, plan=plan)


def test_no_exposure_is_longer_than_its_pattern(capture):
    wrong = replace(capture.buckets, exposure_time_s=2e-3, pattern_period_s=1e-3)
    with pytest.raises(InputError, match=r"exposure_time_s is 0\.002, longer than .*0\.001 s"):
        replace(capture, buckets=wrong)


def test_a_wrong_unit_is_refused(path):
    replace_dataset(path, "spots/detector_positions_m", np.zeros((4, 3)), units="mm")
    with pytest.raises(InputError, match="detector_positions_m has units 'mm', expected 'm'"):
        read_capture(path)


def test_parts_that_do_not_fit_are_refused_before_writing(capture):
    with pytest.raises(InputError, match="buckets/counts"):
        replace(capture, plan=make_plan((4, 8), 9))
    empty = replace(
        capture.buckets, counts=np.zeros((0, 20)), saturated=np.zeros((0, 20), dtype=bool)
    )
    with pytest.raises(InputError, match="holds no frame"):
        replace(capture, poses=None, buckets=empty, spots=None, pattern_taps=None)
    with pytest.raises(InputError, match="source is 'rig'; allowed: simulation, hardware"):
        replace(capture, provenance=replace(capture.provenance, source="rig"))
    with pytest.raises(InputError, match="beyond 32 bits"):
        replace(capture, buckets=replace(capture.buckets, counts=np.full((2, 20), 2**40)))


@pytest.mark.parametrize(
    ("name", "index", "value", "message"),
    [
        ("time_s", 1, 0.005, r"poses/time_s of frame 1 is 0\.005, must be later .* before, 0\.005"),
        ("time_s", 1, np.nan, "poses of frame 1 are nan in part; .* and a time_s"),
        ("position_m", (0, 2), np.nan, "poses of frame 0 are nan in part"),
        ("orientation", (1, 3), 2.0, r"poses/orientation of frame 1 has length 2\.00.*length 1"),
        (
            "covariance",
            (0, 4, 4),
            -1e-6,
            r"poses/covariance has a variance of -1e-06; .* 0 or more",
        ),
        ("covariance", (0, 0, 1), 1e-3, "poses/covariance differs from its transpose; must be sym"),
        (
            "covariance",
            0,
            np.full((6, 6), -1e-4) + 2e-4 * np.eye(6),
            "poses/covariance has correlations with an eigenvalue of -4; must be 0 or more",
        ),
    ],
)
def test_impossible_poses_are_named(path, name, index, value, message):
    with changed(path) as file:
        file[f"poses/{name}"][index] = value
    with pytest.raises(InputError, match=message):
        read_capture(path)


def test_a_pose_is_needed_for_every_frame(capture, path):
    replace_dataset(path, "poses/position_m", np.zeros((1, 3)))
    with pytest.raises(InputError, match=r"poses/position_m has shape \(1, 3\), expected \(frames"):
        read_capture(path)
