"""The capture file: what is written comes back, and what its readings mean."""

import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from captures import full_capture, make_spots
from hdf5files import changed
from reconstruction.capture import PARTS, READINGS, Provenance, read_capture, write_capture
from reconstruction.capture.schema import present_fields
from reconstruction.operators import make_plan
from reconstruction.operators.bases.dense import Dense

FORMAT_PAGE = Path(__file__).parents[2] / "docs" / "reference" / "capture-format.md"


@pytest.fixture
def capture():
    return full_capture()


@pytest.fixture
def path(capture, tmp_path):
    write_capture(capture, tmp_path / "capture.h5")
    return tmp_path / "capture.h5"


@pytest.mark.parametrize("method", READINGS)
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
        part = getattr(capture, group)
        assert type(getattr(copy, group)) is type(part)
        for name, _ in present_fields(part):
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
        poses=None,
        provenance=Provenance("hardware", "rig", "2025", ""),
    )
    write_capture(plain, tmp_path / "plain.h5")
    copy = read_capture(tmp_path / "plain.h5")
    absent = (copy.spots, copy.optics, copy.truth, copy.pattern_taps, copy.poses)
    assert absent == (None,) * 5
    assert copy.provenance.seed is None


NOT_NEEDED = (
    "detector_axes",
    "half_fields_rad",
    "falloffs",
    "aperture_radii_m",
    "beam_divergence_rad",
    "beam_waist_m",
    "electrons_per_joule",
    "laser_energies_j",
    "contrasts",
    "laser_energy_j",
)


@pytest.mark.parametrize("method", READINGS)
def test_what_only_fog_needs_may_be_absent_and_is_then_nan(capture, path, method):
    write_capture(replace(capture, spots=make_spots(method)), path)
    with changed(path) as file:
        absent = [name for name in NOT_NEEDED if name in file["spots"]]
        for name in absent:
            del file[f"spots/{name}"]
    assert len(absent) == {"cw": 9, "pulsed": 8, "dtof": 8}[method]
    copy = read_capture(path).spots
    for name, stored in present_fields(copy):
        expected = getattr(make_spots(method), name)
        if name in absent:
            sizes = tuple(4 if axis == "spots" else axis for axis in stored.axes)
            given = all(isinstance(size, int) for size in sizes)
            expected = np.full(sizes if given else (), np.nan)
        assert np.array_equal(getattr(copy, name), expected, equal_nan=True), name


def test_one_value_may_stand_for_all_taps(capture, path):
    alike = {"periods": 70, "noise_electrons": 9.0, "laser_energies_j": 1e-6, "contrasts": 0.5}
    spots = replace(capture.spots, **alike)
    write_capture(replace(capture, spots=spots), path)
    with changed(path) as file:  # as MATLAB has it
        del file["spots/periods"]
        file["spots/periods"] = np.array([[70.0]])
        file["spots/periods"].attrs["units"] = "1"
    copy = read_capture(path).spots
    assert {name: getattr(copy, name) for name in alike} == alike
    path_m = np.linspace(0, 30, 7)
    each = replace(spots, **{name: np.full(3, value) for name, value in alike.items()})
    assert np.array_equal(copy.response(path_m), each.response(path_m))


def test_equal_captures_give_equal_bytes(capture, path, tmp_path):
    write_capture(capture, tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == path.read_bytes()
    with h5py.File(path) as file:  # and a second later too
        file.visititems(lambda _, item: timeless(item))


def timeless(item):
    assert not item.id.get_create_plist().get_obj_track_times()


def test_every_dataset_is_documented_with_its_units(capture, path):
    page = FORMAT_PAGE.read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+/\w+)` \|[^|]*\|[^|]*\| ([^|]+) \|", page, re.MULTILINE))
    stored = {}
    patterns = Dense(np.ones((32, 4, 8)))
    dense = replace(capture.plan, patterns=patterns, throughput=np.ones(32))
    for method in READINGS:
        spots = make_spots(method)
        spots = replace(spots, pointing=np.tile(spots.directions, (capture.frames, 1, 1)))
        write_capture(replace(capture, plan=dense, spots=spots), path)
        with h5py.File(path) as file:
            file.visititems(
                lambda name, item: (
                    stored.update({name: item.attrs["units"].decode()})
                    if isinstance(item, h5py.Dataset)
                    else None
                )
            )
    others = {"patterns/permutation": "1", "spots/pointing": "1"}  # of scrambled, of steered ones
    others |= {"spots/response": "1", "spots/response_s": "s"}  # of no Gaussian
    assert rows == stored | others


def test_a_foreign_writer_may_use_other_number_types_and_fixed_strings(capture, path):
    with changed(path) as file:
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


def test_the_signal_is_in_electrons_or_in_counts_where_their_scale_is_unknown(capture):
    buckets = capture.buckets
    assert buckets.unit == "electron"
    buckets = replace(buckets, dead_time_s=0.0)
    np.testing.assert_allclose(buckets.signal, 900.0 * (buckets.counts - 100.0))
    unscaled = replace(buckets, electrons_per_count=np.nan)
    assert unscaled.unit == "count"
    np.testing.assert_allclose(unscaled.signal, buckets.counts - 100.0)


def test_the_digest_follows_readings_and_patterns_and_nothing_else(capture, path):
    def digests(capture):
        return tuple(capture.frame(k).digest(capture.setup) for k in range(capture.frames))

    assert digests(read_capture(path)) == digests(capture)
    as_numbers = replace(capture.buckets, counts=capture.buckets.counts.astype(float))
    assert digests(replace(capture, buckets=as_numbers, truth=None)) == digests(capture)
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
        replace(capture, plan=replace(capture.plan, shape=(8, 4), patterns=None), truth=None),
    ]
    assert len({digests(c) for c in [capture, *others]}) == 8
    assert digests(others[0])[0] == digests(capture)[0]  # the other frame is changed
    patterns = np.random.default_rng(0).random((32, 4, 8))
    dense = [
        replace(capture, plan=replace(capture.plan, patterns=Dense(displayed)))
        for displayed in (patterns, 1 - patterns)
    ]
    assert len({digests(c) for c in [capture, *dense]}) == 3


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


def test_a_failed_write_leaves_the_old_file_and_nothing_else(capture, path, monkeypatch):
    before = path.read_bytes()

    def no_space(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", no_space)
    with pytest.raises(OSError, match=r"No space left on device: '.*/capture\.h5'$"):
        write_capture(replace(capture, truth=None), path)
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == ["capture.h5"]
