"""The capture file: what is written comes back, and nothing broken, foreign or newer is read."""

import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from damage import refusals
from reconstruction.capture import (
    PARTS,
    Buckets,
    Capture,
    Optics,
    Provenance,
    Truth,
    read_capture,
    write_capture,
)
from reconstruction.errors import InputError
from reconstruction.patterns import make_plan
from reconstruction.schema import stored_fields
from reconstruction.spots import METHODS, CwSpots, HistogramSpots, PatternTaps, PulsedSpots

FORMAT_PAGE = Path(__file__).parents[2] / "docs" / "capture-format.md"


DIRECTIONS = np.tile([0.0, 0.6, 0.8], (4, 1))
CHARGE = {
    "electrons_per_count": 1.5,
    "offset_counts": 20.0,
    "noise_electrons": 100.0,
    "excess_noise_factor": 5.5,
}


def make_spots(method):
    """Readings of two frames by any method."""
    rng = np.random.default_rng(1)
    common = {"directions": DIRECTIONS, "detector_positions_m": rng.random((4, 3))}
    if method == "cw":
        return CwSpots(
            **common,
            **CHARGE | {"noise_electrons": np.array([100.0, 90.0, 80.0])},
            taps=rng.random((2, 4, 3)),
            saturated=np.zeros((2, 4, 3), dtype=bool),
            tap_frequencies_hz=np.full(3, 15e6),
            tap_phases_rad=np.array([0.0, 2.0, 4.0]),
            phase_offsets_rad=np.full(3, 0.1),
            periods=1000,
        )
    if method == "pulsed":
        return PulsedSpots(
            **common,
            **CHARGE,
            taps=rng.random((2, 4, 3)),
            saturated=np.zeros((2, 4, 3), dtype=bool),
            window_starts_s=np.array([-70e-9, 0, 65e-9]),
            pulse_width_s=65e-9,
            pulses=1000,
            delay_offset_s=1e-9,
        )
    return HistogramSpots(
        **common,
        counts=rng.integers(0, 9, (2, 4, 50), dtype=np.int32),
        saturated=np.zeros((2, 4), dtype=bool),
        bin_width_s=1e-9,
        start_s=5e-9,
        pulses=10_000,
        response_sigma_s=0.5e-9,
        delay_offset_s=1e-9,
    )


@pytest.fixture
def capture():
    rng = np.random.default_rng(0)
    plan = make_plan((4, 8), 10)
    image = rng.random((4, 8)).astype(np.float32)
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=rng.integers(0, 65536, (2, 20), dtype=np.int32),
            saturated=rng.random((2, 20)) < 0.1,
            exposure_time_s=60e-6,
            pattern_period_s=67e-6,
            electrons_per_count=900.0,
            offset_counts=100.0,
            noise_electrons=5e4,
            excess_noise_factor=1.0,
            dead_time_s=1e-13,
        ),
        spots=make_spots("cw"),
        optics=Optics(tan_half_width=0.2, tan_half_height=0.1),
        provenance=Provenance(
            "simulation", "spisim 0", "2025-01-01T00:00:00+00:00", "λ: 1550", "s", 7, "spp: 1"
        ),
        truth=Truth(
            image, image / 9, image, np.where(image > 0.5, image, np.nan), image, rng.random(4)
        ),
        pattern_taps=PatternTaps(
            **CHARGE,
            taps=rng.integers(0, 4096, (2, 20, 6), dtype=np.int32),
            saturated=rng.random((2, 20, 6)) < 0.1,
            tap_frequencies_hz=np.repeat([15e6, 20e6], 3),
            tap_phases_rad=np.tile([0.0, 2.0, 4.0], 2),
            phase_offsets_rad=np.repeat([0.1, 0.2], 3),
            detector_position_m=rng.random(3),
        ),
    )


@pytest.fixture
def path(capture, tmp_path):
    write_capture(capture, tmp_path / "capture.h5")
    return tmp_path / "capture.h5"


@pytest.mark.parametrize("method", METHODS)
def test_everything_comes_back(capture, path, method):
    capture = replace(capture, spots=make_spots(method))
    write_capture(capture, path)
    copy = read_capture(path)
    assert copy.provenance == capture.provenance
    assert copy.plan.shape == capture.plan.shape
    assert copy.plan.order == "sequency-2d"
    assert np.array_equal(copy.plan.index, capture.plan.index)
    assert np.array_equal(copy.plan.polarity, capture.plan.polarity)
    for group in PARTS:
        part = type(getattr(capture, group))
        assert type(getattr(copy, group)) is part
        for name, _ in stored_fields(part):
            before, after = (getattr(getattr(c, group), name) for c in (capture, copy))
            assert np.array_equal(before, after, equal_nan=True), name
            assert type(before) is type(after), name
            assert np.asarray(before).dtype == np.asarray(after).dtype, name


def test_optional_parts_may_be_absent(capture, tmp_path):
    plain = replace(
        capture,
        spots=None,
        optics=None,
        truth=None,
        pattern_taps=None,
        provenance=Provenance("hardware", "rig", "2025", ""),
    )
    write_capture(plain, tmp_path / "plain.h5")
    copy = read_capture(tmp_path / "plain.h5")
    assert (
        copy.spots is copy.optics is copy.truth is copy.pattern_taps is copy.provenance.seed is None
    )


def test_equal_captures_give_equal_bytes(capture, path, tmp_path):
    write_capture(capture, tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()


def test_every_dataset_is_documented_with_its_units(capture, path):
    page = FORMAT_PAGE.read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+/\w+)` \|[^|]*\|[^|]*\| ([^|]+) \|", page, re.MULTILINE))
    stored = {}
    for method in METHODS:
        write_capture(replace(capture, spots=make_spots(method)), path)
        with h5py.File(path) as file:
            file.visititems(
                lambda name, item: (
                    stored.update({name: item.attrs["units"].decode()})
                    if isinstance(item, h5py.Dataset)
                    else None
                )
            )
    assert rows == stored


def test_a_foreign_writer_may_use_other_number_types_and_fixed_strings(capture, path):
    with h5py.File(path, "r+") as file:
        for name, value in {
            "patterns/shape": np.array([4.0, 8.0]).astype(np.int64),
            "patterns/index": capture.plan.index.astype(np.uint16),
            "patterns/basis": np.array([b"hadamard"]),
            "buckets/saturated": capture.buckets.saturated.astype(np.int32),
            "buckets/offset_counts": np.array([100], dtype=np.uint8),
        }.items():
            units = file[name].attrs["units"]
            del file[name]
            file[name] = value
            file[name].attrs["units"] = np.bytes_(units)
        file["recorder/serial_number"] = 5
    copy = read_capture(path)
    assert copy.buckets.offset_counts == 100.0
    assert np.array_equal(copy.buckets.saturated, capture.buckets.saturated)
    assert copy.buckets.saturated.dtype == bool


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.h5: no such capture file"):
        read_capture(tmp_path / "none.h5")


@pytest.mark.parametrize("length", [0, 100, 3000, -1])
def test_truncated_files_are_refused(path, length):
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(InputError, match=r"capture\.h5: not an HDF5 file, or truncated or damaged"):
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

    monkeypatch.setattr("reconstruction.capture.get", broken)
    with pytest.raises(InputError, match=r"capture\.h5: .*damaged"):
        read_capture(path)


def test_a_text_that_is_not_utf_8_is_damage(path):
    with h5py.File(path, "r+") as file:
        del file["patterns/basis"]
        file["patterns/basis"] = np.bytes_(b"\xff\xfe")
        file["patterns/basis"].attrs["units"] = "1"
    with pytest.raises(InputError, match=r"damaged .*utf-8"):
        read_capture(path)


def test_the_signal_is_in_electrons_or_in_counts_where_their_scale_is_unknown(capture):
    buckets = capture.buckets
    assert buckets.unit == "electron"
    buckets = replace(buckets, dead_time_s=0.0)
    np.testing.assert_allclose(buckets.signal, 900.0 * (buckets.counts - 100.0))
    unscaled = replace(buckets, electrons_per_count=np.nan)
    assert unscaled.unit == "count"
    np.testing.assert_allclose(unscaled.signal, buckets.counts - 100.0)


def test_the_digest_follows_readings_and_patterns_and_nothing_else(capture, path):
    assert read_capture(path).digest == capture.digest
    as_numbers = replace(capture.buckets, counts=capture.buckets.counts.astype(float))
    assert replace(capture, buckets=as_numbers, truth=None).digest == capture.digest
    counts = capture.buckets.counts.copy()
    counts[1, 3] += 1
    taps = capture.spots.taps.copy()
    taps[0, 0, 0] += 1
    pattern_taps = capture.pattern_taps.taps.copy()
    pattern_taps[0, 0, 0] += 1
    order = make_plan((4, 8), 10, order="natural")
    others = [
        replace(capture, buckets=replace(capture.buckets, counts=counts)),
        replace(capture, spots=replace(capture.spots, taps=taps)),
        replace(capture, spots=None),
        replace(capture, spots=make_spots("dtof")),
        replace(capture, pattern_taps=replace(capture.pattern_taps, taps=pattern_taps)),
        replace(capture, plan=order),
        replace(capture, plan=replace(capture.plan, shape=(8, 4)), truth=None),
    ]
    assert len({c.digest for c in [capture, *others]}) == 8


@pytest.mark.parametrize("version", ["2.1", "3.0", "10.0"])
def test_newer_versions_are_refused_naming_both(path, version):
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = version
    with pytest.raises(InputError, match=rf"newer format version {version}.*reads up to 2\.0"):
        read_capture(path)


@pytest.mark.parametrize("version", ["0.9", "1.0", "1.7"])
def test_older_versions_are_refused_naming_both(path, version):
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = version
    with pytest.raises(InputError, match=rf"older format version {version}.*reads 2\.0 to 2\.0"):
        read_capture(path)


@pytest.mark.parametrize("version", ["one", "1", "1.0.0"])
def test_malformed_versions_are_refused(path, version):
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = version
    with pytest.raises(InputError, match="not of the form"):
        read_capture(path)


@pytest.mark.parametrize(
    "name",
    ["patterns/index", "patterns/basis", "buckets/counts", "spots/taps", "provenance/scene"],
)
def test_a_missing_dataset_is_named(path, name):
    with h5py.File(path, "r+") as file:
        del file[name]
    with pytest.raises(InputError, match=f"dataset {name} is missing"):
        read_capture(path)


def replace_dataset(path, name, value, units=None):
    with h5py.File(path, "r+") as file:
        kept = file[name].attrs["units"]
        del file[name]
        file[name] = value
        file[name].attrs["units"] = kept if units is None else units


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("buckets/counts", np.zeros((2, 19)), r"shape \(2, 19\).*frames = 2, exposures = 20"),
        ("buckets/counts", np.full((2, 20), np.nan), "not finite"),
        ("buckets/counts", b"text", "must hold numbers"),
        ("buckets/exposure_time_s", 0.0, "must be positive"),
        ("buckets/offset_counts", np.zeros(2), "expected .a scalar"),
        ("spots/taps", np.zeros((1, 4, 3)), r"shape \(1, 4, 3\), expected \(frames = 2"),
        ("spots/directions", np.eye(3), r"shape \(3, 3\), expected \(4 = 4, 3 = 3\)"),
        ("spots/directions", np.tile([0, 0, 57.0], (4, 1)), "unit vectors"),
        ("spots/tap_frequencies_hz", np.full(3, -1.0), "must be positive"),
        ("spots/tap_frequencies_hz", [1e6, 1e6, 2e6], "1e.06 Hz has 2 tap.* at least 3"),
        ("spots/tap_phases_rad", [0, 1, 1 + 2 * np.pi], "fewer than 3 different phases"),
        ("spots/method", "pulse", "did you mean 'pulsed'. allowed: cw, pulsed, dtof"),
        ("buckets/dead_time_s", -1e-9, "must be not negative"),
        ("buckets/excess_noise_factor", 0.0, "must be positive"),
        ("buckets/exposure_time_s", np.nan, "exposure_time_s must be known"),
        ("buckets/electrons_per_count", np.nan, "electrons_per_count must be known"),
        ("pattern_taps/taps", np.zeros((2, 19, 6)), r"exposures = 20, pattern taps = 6"),
        ("pattern_taps/tap_frequencies_hz", np.arange(1.0, 7), "at least 3"),
        ("truth/depth_m", np.zeros((8, 4)), "height = 4, width = 8"),
        ("patterns/index", np.full(20, 32), r"outside 0\.\.31"),
        ("patterns/shape", np.array([4, 8, 1]), r"patterns/shape has shape \(3,\)"),
        ("patterns/shape", np.array([4, 7]), "powers of two"),
        ("patterns/basis", "fourier", "'fourier'; allowed: hadamard"),
    ],
)
def test_a_wrong_dataset_is_named(path, name, value, message):
    replace_dataset(path, name, value)
    with pytest.raises(InputError, match=message) as error:
        read_capture(path)
    assert str(error.value).startswith(str(path))
    assert name.split("/")[1] in str(error.value) or "pattern" in str(error.value)


@pytest.mark.parametrize(
    ("method", "changes", "message"),
    [
        ("pulsed", {"taps": np.zeros((2, 4, 4))}, r"spots/taps has shape \(2, 4, 4\)"),
        ("pulsed", {"window_starts_s": np.array([-70e-9, 0, 60e-9])}, "must start where the first"),
        ("pulsed", {"window_starts_s": np.array([64e-9, 0, 65e-9])}, "background window overlaps"),
        ("pulsed", {"pulse_width_s": 0.0}, "spots/pulse_width_s is 0.0, must be positive"),
        ("dtof", {"counts": np.zeros((2, 4, 2))}, "spots/counts has 2 bins.*at least 3"),
        ("dtof", {"counts": np.full((2, 4, 50), 201)}, "10050 arrivals.*pulses = 10000 cycles"),
        ("dtof", {"counts": np.full((2, 4, 50), -1)}, "spots/counts is -1, must be not negative"),
        ("dtof", {"saturated": np.zeros((2, 4, 50), bool)}, "spots/saturated has shape"),
        ("dtof", {"response_sigma_s": 0.0}, "spots/response_sigma_s is 0.0, must be positive"),
    ],
)
def test_readings_that_cannot_be_are_refused(capture, method, changes, message):
    with pytest.raises(InputError, match=message):
        replace(capture, spots=replace(make_spots(method), **changes))


@pytest.mark.parametrize("start", [-65e-9, 130e-9])
def test_the_background_window_may_touch_the_others(capture, start):
    spots = replace(make_spots("pulsed"), window_starts_s=np.array([start, 0, 65e-9]))
    assert replace(capture, spots=spots).spots is spots


def test_dead_time_needs_counted_readings(capture):
    plan = replace(capture.plan, polarity=np.zeros(20, dtype=np.int8))
    with pytest.raises(InputError, match=r"patterns/polarity 0 marks readings as differences"):
        replace(capture, plan=plan)


def test_dead_time_is_corrected_and_its_variance_is_the_scatter(capture):
    """Against non-extended dead times between exponential arrivals, one by one."""
    rate, dead, time, trials = 200.0, 0.002, 1.0, 2000
    rng = np.random.default_rng(0)
    detections = np.cumsum(rng.exponential(1 / rate, (trials, 300)) + dead, axis=1) - dead
    assert (detections[:, -1] > time).all()
    counts = (detections < time).sum(axis=1)
    buckets = replace(
        capture.buckets,
        counts=counts[None],
        saturated=np.zeros((1, trials), dtype=bool),
        exposure_time_s=time,
        electrons_per_count=1.0,
        offset_counts=0.0,
        noise_electrons=0.0,
        dead_time_s=dead,
    )
    sigma = np.sqrt(buckets.variance.mean())
    assert sigma == pytest.approx(np.sqrt(rate * (1 + rate * dead)), rel=0.01)
    chi_squared = (trials - 1) * (buckets.signal.std(ddof=1) / sigma) ** 2
    assert abs(chi_squared - trials) / np.sqrt(2 * trials) < 4
    # The detector is ready at the start, which gives 0.04 detections more (Mueller's "free").
    ready = 0.04 * (1 + rate * dead) ** 2
    z = (buckets.signal.mean() - rate - ready) / (sigma / np.sqrt(trials))
    assert abs(z) < 3.5


def test_a_detector_that_is_always_blind_is_not_usable(capture):
    buckets = replace(
        capture.buckets,
        counts=np.array([[0, 999, 1000, 1500]]),
        saturated=np.array([[True, False, False, False]]),
        exposure_time_s=1e-3,
        electrons_per_count=1.0,
        offset_counts=0.0,
        dead_time_s=1e-6,
    )
    assert buckets.usable.tolist() == [[False, True, False, False]]
    assert np.isfinite(buckets.signal).all()
    assert buckets.signal[0, 1] == pytest.approx(999_000)


def test_excess_noise_multiplies_shot_noise_only(capture):
    buckets = replace(capture.buckets, dead_time_s=0.0, excess_noise_factor=5.5)
    expected = 5.5 * np.abs(buckets.signal) + buckets.noise_electrons**2
    np.testing.assert_allclose(buckets.variance, expected)
    unknown = replace(buckets, electrons_per_count=np.nan)
    assert np.isnan(unknown.variance).all()


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
        replace(capture, buckets=empty, spots=None, pattern_taps=None)
    with pytest.raises(InputError, match="source is 'rig'; allowed: simulation, hardware"):
        replace(capture, provenance=replace(capture.provenance, source="rig"))
    with pytest.raises(InputError, match="beyond 32 bits"):
        replace(capture, buckets=replace(capture.buckets, counts=np.full((2, 20), 2**40)))


def test_a_failed_write_leaves_the_old_file_and_nothing_else(capture, path, monkeypatch):
    before = path.read_bytes()

    def no_space(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", no_space)
    with pytest.raises(OSError, match=r"No space left on device: '.*/capture\.h5'$"):
        write_capture(replace(capture, truth=None), path)
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == ["capture.h5"]
