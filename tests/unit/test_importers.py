"""Importing arrays: every file type, plans verified against the patterns, and bad input named."""

import struct
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from scipy.linalg import hadamard

from images import signed_coefficients
from reconstruction import read_capture, reconstruct, write_capture
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import capture_from_readings, load_array, plan_from_matrix
from reconstruction.cli import main
from reconstruction.operators import expose, illumination, make_plan

CAR = Path(__file__).parents[1] / "data" / "car_buckets_201.npy"
VALUES = np.arange(6, dtype=np.int32).reshape(1, 6)


def write_mat73(path):
    with h5py.File(path, "w") as file:
        file["data"] = VALUES.T
        file.create_group("#refs#")


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.npy", lambda path: np.save(path, VALUES)),
        ("a.npz", lambda path: np.savez(path, data=VALUES)),
        ("a.csv", lambda path: np.savetxt(path, VALUES, delimiter=",")),
        ("a.mat", lambda path: scipy.io.savemat(path, {"data": VALUES})),
        ("a.MAT", write_mat73),
    ],
)
def test_every_file_type_gives_the_same_numbers(tmp_path, name, write):
    write(tmp_path / name)
    assert np.array_equal(load_array(tmp_path / name).ravel(), VALUES.ravel())


def element(kind, data):
    """Of a MATLAB file of version 5: type, size, data, to a multiple of 8 bytes."""
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def stranger(kind, name):
    """An element of a class that holds no numbers: 3 an object, 16 a function, 17 a newer object.

    After flags, dimensions and name comes what such a one has; MathWorks, "MAT-File Format".
    """
    flags, title = element(6, struct.pack("<II", kind, 0)), element(1, name)
    one = element(5, struct.pack("<ii", 1, 1))
    number = element(6, struct.pack("<II", 6, 0)) + one + element(1, b"") + element(9, bytes(8))
    if kind == 17:
        title += element(1, b"MCOS") + element(1, b"table")
    if kind == 3:
        title += (
            element(1, b"Scene") + element(5, struct.pack("<i", 8)) + element(1, b"width".ljust(8))
        )
    return element(14, flags + (b"" if kind == 17 else one) + title + element(14, number))


@pytest.mark.parametrize("kind", [3, 16, 17])
@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize("compressed", [True, False])
@pytest.mark.parametrize("variable", [None, "data"])
def test_objects_beside_numbers_are_left_out(tmp_path, kind, is_first, compressed, variable):
    """A recording is read whatever else its program keeps in the file."""
    scipy.io.savemat(tmp_path / "a.mat", {"data": VALUES})
    whole = (tmp_path / "a.mat").read_bytes()
    more = stranger(kind, b"settings")
    if compressed:
        more = struct.pack("<II", 15, len(zlib.compress(more))) + zlib.compress(more)
    parts = [more, whole[128:]] if is_first else [whole[128:], more]
    (tmp_path / "a.mat").write_bytes(b"".join([whole[:128], *parts]))
    with pytest.warns(UserWarning, match=r"a\.mat: left out, .*'settings'"):
        assert np.array_equal(load_array(tmp_path / "a.mat", variable), VALUES)


def test_a_file_of_objects_alone_is_refused(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {})
    with (tmp_path / "a.mat").open("ab") as file:
        file.write(stranger(17, b"settings"))
    with (
        pytest.warns(UserWarning, match="'settings'"),
        pytest.raises(InputError, match="name one of its variables"),
    ):
        load_array(tmp_path / "a.mat")


def test_one_of_several_variables(tmp_path):
    np.savez(tmp_path / "a.npz", data=VALUES, other=np.zeros(3))
    assert np.array_equal(load_array(tmp_path / "a.npz", "data"), VALUES)
    with pytest.raises(InputError, match="name one of its variables: data, other"):
        load_array(tmp_path / "a.npz")
    with pytest.raises(InputError, match="no variable 'dta': did you mean 'data'"):
        load_array(tmp_path / "a.npz", "dta")


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.mat", "a.csv"])
def test_broken_files_are_named(tmp_path, name):
    (tmp_path / name).write_bytes(b"\x93NUMPY rubbish")
    with pytest.raises(
        InputError, match=rf"{name}: (not a readable|should hold numbers|must contain numbers)"
    ):
        load_array(tmp_path / name)


def test_missing_files_foreign_types_and_texts_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"a\.npy: no such file"):
        load_array(tmp_path / "a.npy")
    with pytest.raises(InputError, match=r"a\.xlsx: unknown file type; allowed: \.mat, \.npy"):
        load_array(tmp_path / "a.xlsx")
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InputError, match=r"empty\.csv: holds no numbers"):
        load_array(tmp_path / "empty.csv")
    np.save(tmp_path / "text.npy", np.array(["a"]))
    with pytest.raises(InputError, match="must contain real numbers"):
        load_array(tmp_path / "text.npy")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2\n3,nan\n", r"n\.csv: the value at \[1, 1\] is nan, must be finite"),
        ("1\n2\n-inf\n", r"n\.csv: the value at \[2\] is -inf"),
    ],
)
def test_a_value_that_is_not_finite_is_named_with_its_place(tmp_path, text, message):
    (tmp_path / "n.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        load_array(tmp_path / "n.csv")


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_patterns_are_recognised_row_by_row(polarity):
    original = make_plan((4, 8), 12, polarity=polarity)
    matrix = [illumination(original, k).ravel() for k in range(original.exposures)]
    plan, sign = plan_from_matrix(matrix, (4, 8))
    assert np.array_equal(plan.index, original.index)
    assert np.array_equal(plan.polarity, original.polarity)
    assert (sign == 1).all()


def test_an_inverted_signed_pattern_inverts_its_reading():
    matrix = hadamard(16)[[3, 5, 9]] * np.array([[1], [-1], [1]])
    plan, sign = plan_from_matrix(matrix, (4, 4))
    image = np.random.default_rng(0).random((4, 4))
    readings = matrix @ image.ravel()
    assert np.allclose(signed_coefficients(plan, readings * sign)[1], expose(plan, image))


RANDOM = np.random.default_rng(1)
OTHERS = {
    "random": (RANDOM.integers(0, 2, (30, 12)).astype(float), (3, 4)),
    "grey": (RANDOM.random((20, 16)), (4, 4)),
    "random signs": (RANDOM.choice([-1.0, 1.0], (20, 16)), (4, 4)),
    "signed grey": (RANDOM.uniform(-1, 1, (20, 15)), (3, 5)),
    "all but one are Hadamard's": (np.vstack([hadamard(16)[:2], np.eye(16)[:1] * 2 - 1]), (4, 4)),
    "grey beside all-on": (np.vstack([np.ones((1, 16)), np.full((1, 16), 0.5)]), (4, 4)),
    "one pixel each": (np.eye(12), (3, 4)),
    "Hadamard's, of sides that are no powers of two": (hadamard(4)[:, :3], (1, 3)),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_other_patterns_are_a_basis_of_their_own(kind):
    matrix, shape = OTHERS[kind]
    plan, sign = plan_from_matrix(matrix, shape)
    assert plan.basis == "dense"
    assert (sign == 1).all()
    assert (plan.polarity == (1 if matrix.min() >= 0 else 0)).all()
    displayed = [illumination(plan, k).ravel() for k in range(plan.exposures)]
    np.testing.assert_allclose(displayed, matrix, atol=1e-7)
    image = RANDOM.random(shape)
    np.testing.assert_allclose(expose(plan, image), matrix @ image.ravel(), atol=1e-6)


def test_a_recording_with_random_patterns_becomes_an_image(tmp_path):
    """As many exposures as pixels and half as many again, on a steady background: exact."""
    matrix = RANDOM.integers(0, 2, (180, 120)).astype(np.int8)
    image = RANDOM.random((10, 12))
    readings = 1e4 * (matrix @ image.ravel() + 7)
    scipy.io.savemat(tmp_path / "a.mat", {"data": readings, "shown": matrix})
    arguments = ["import", str(tmp_path / "a.mat"), "-o", str(tmp_path / "a.h5")]
    of_file = ["--shape", "10x12", "--variable", "data", "--patterns-variable", "shown"]
    assert main([*arguments, *of_file]) == 0
    result = reconstruct(read_capture(tmp_path / "a.h5"))
    for estimated_image in result.images.values():
        np.testing.assert_allclose(estimated_image, 1e4 * image, atol=1)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.ones((3, 5)), r"shape \(3, 5\), expected \(M, 16\)"),
        (np.ones((0, 16)), r"shape \(0, 16\), expected \(M, 16\)"),
        (hadamard(16)[:2] * 1.5, "row 0 of the pattern matrix holds 1.5; allowed: 0..1 for disp"),
        (np.vstack([np.ones((2, 16)), np.full((1, 16), 255)]), "row 2 of the pattern .* holds 255"),
        (np.vstack([np.zeros((1, 16)), np.full((1, 16), np.nan)]), "row 1 of the .* holds nan"),
        (np.full((1, 16), -1.01), "row 0 of the pattern matrix holds -1.01; .*-1..1 for signed"),
    ],
)
def test_what_is_no_pattern_is_refused(matrix, message):
    with pytest.raises(InputError, match=message):
        plan_from_matrix(matrix, (4, 4))


def test_the_measured_car_becomes_a_capture(tmp_path):
    plan = make_plan((32, 32), order="natural", polarity="signed")
    write_capture(capture_from_readings(np.load(CAR), plan, untrusted=[0]), tmp_path / "car.h5")
    capture = read_capture(tmp_path / "car.h5")
    assert capture.provenance.source == "hardware"
    assert capture.buckets.counts.dtype == np.int32
    assert capture.spots is None
    assert capture.buckets.unit == "count"
    assert reconstruct(capture).unit == "count"
    image = reconstruct(capture).images["zero-filled"]
    inverse = (hadamard(1024) @ np.load(CAR)).reshape(32, 32) / 1024
    assert np.allclose(image - image.mean(), inverse - inverse.mean(), atol=1e-4)
    assert image.min() == 0  # the mean level was not to be trusted


def test_several_frames():
    plan = make_plan((2, 2), polarity="signed")
    assert capture_from_readings(np.zeros((3, 4)), plan).frames == 3
    assert capture_from_readings(np.zeros((4, 1)), plan).frames == 1


@pytest.mark.parametrize(
    ("readings", "untrusted", "message"),
    [
        (np.zeros(5), [], r"shape \(5,\); the pattern plan expects 4 per frame"),
        (np.zeros((5, 3)), [], r"shape \(5, 3\)"),
        (np.ones(4, dtype=bool), [], "booleans"),
        (np.zeros(4), [4], r"untrusted reading 4 is outside 0\.\.3"),
        (np.array([1, 2, np.nan, 4]), [], "not finite"),
    ],
)
def test_bad_readings_are_refused(readings, untrusted, message):
    with pytest.raises(InputError, match=message):
        capture_from_readings(readings, make_plan((2, 2), polarity="signed"), untrusted)


def test_where_real_numbers_are_wanted_complex_ones_are_named(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"data": np.ones(3) * 1j})
    with pytest.raises(InputError, match="holds complex128, not real numbers"):
        load_array(tmp_path / "a.mat")
