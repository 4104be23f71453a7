"""Photon counts of a camera with a mirror array, by their file names."""

import numpy as np
import pytest

from images import correlation, natural_image
from reconstruction import read_capture, reconstruct
from reconstruction.base.errors import InputError
from reconstruction.cli import importing, main
from reconstruction.operators import expose, make_plan
from spisim_formats.recordings.photon_counts import RECORDING

NAME = "240321_13_256_20000_150_0.npy"
IMAGE = natural_image(16, 2)
PLAN = make_plan((16, 16), order="natural")


def counts():
    light = expose(PLAN, IMAGE / IMAGE.sum() * 20000)
    return np.random.default_rng(1).poisson(light).astype(float)


@pytest.mark.parametrize("shape", [(256, 2), (512,)])
def test_a_recording_becomes_a_capture(tmp_path, monkeypatch, shape):
    np.save(tmp_path / NAME, counts().reshape(shape))
    monkeypatch.setattr(importing, "program_of", lambda path: RECORDING)
    out = tmp_path / "a.h5"
    assert main(["import", str(tmp_path / NAME), "-o", str(out)]) == 0
    capture = read_capture(out)
    assert capture.plan.shape == (16, 16)
    assert capture.buckets.exposure_time_s == pytest.approx(0.02)
    assert capture.buckets.unit == "electron"
    np.testing.assert_array_equal(capture.buckets.variance, capture.buckets.counts)
    assert correlation(reconstruct(capture).image, IMAGE) > 0.9


def test_other_files_are_not_taken_for_one(tmp_path):
    assert RECORDING.recognises(tmp_path / NAME)
    for name in ("a.npy", "240321_13_256.npy", "240321_13_256_20000.npz", "x240321_1_256_20.npy"):
        assert not RECORDING.recognises(tmp_path / name)


def changed(at, value):
    result = counts()
    result[at] = value
    return result


BAD = {
    "not square": ("240321_13_200_20000_0.npy", counts(), "named for 200 patterns"),
    "no power of two": ("240321_13_144_20000_0.npy", counts(), "power of two"),
    "another length": ("240321_13_1024_20000_0.npy", counts(), r"shape \(512,\), expected \(1024"),
    "an hour": ("240321_13_256_999999999_0.npy", counts(), "999999999 us; allowed"),
    "no exposure": ("240321_13_256_0_0.npy", counts(), "0 us; allowed"),
    "negative": (NAME, changed(9, -1), "no counts: whole numbers"),
    "fractions": (NAME, changed(9, 0.5), "no counts: whole numbers"),
    "nan": (NAME, changed(9, np.nan), "must be finite"),
    "no first pair": (NAME, changed(0, 0), "must be all on and all off"),
}


@pytest.mark.parametrize(("name", "values", "message"), BAD.values(), ids=BAD)
def test_bad_recordings_are_refused(tmp_path, name, values, message):
    np.save(tmp_path / name, values)
    with pytest.raises(InputError, match=message):
        RECORDING.load(tmp_path / name)


def test_a_band_is_refused(tmp_path):
    np.save(tmp_path / NAME, counts())
    with pytest.raises(InputError, match="all wavelengths"):
        RECORDING.load(tmp_path / NAME, (500, 600))
