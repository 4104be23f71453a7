"""Recordings as programs and instruments of laboratories write them become captures."""

import re

import h5py
import numpy as np
import pytest
import scipy.io
from scipy.linalg import hadamard

from reconstruction import measure_ranges, read_capture
from reconstruction.base.constants import c
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import load_array, plan_from_matrix
from reconstruction.cli import main
from reconstruction.operators import expose

READINGS = np.random.default_rng(0).normal(0, 1000, 64).round(6)
KEYSIGHT = "x-axis,1\nsecond,Volt\n"
TEKTRONIX = (
    "Model,MSO54\nHorizontal Units,s\nHorizontal Scale,4e-06\nHorizontal Delay,0\n"
    "Sample Interval,3.2e-10\nRecord Length,64\nVertical Scale,0.5\n,\nLabel,\nTIME,CH1\n"
)
RIGOL = "X,CH1,Start,Increment,\nSequence,Volt,-1.2e-3,4e-7\n"
OLD_TEKTRONIX = ("Record Length,64,", "Sample Interval,4e-06,", "Source,CH1,")
AVAILABLE = ["--taps-electrons-per-count", 1, "--taps-noise-electrons", 30]
RANGES_M = np.array([1.0, 2.5, 4.0, 6.0])


def cw_taps(frequency_hz):
    """Four taps of four spots (4, 4) in electrons."""
    phase = 4 * np.pi * frequency_hz / c * RANGES_M
    return 9000 + 4000 * np.cos(phase[:, None] - np.arange(4) * np.pi / 2)


def imported(folder, *options):
    """The capture that a file becomes."""
    assert main(["import", *map(str, options), "-o", str(folder / "a.h5"), "--overwrite"]) == 0
    return read_capture(folder / "a.h5")


def refused(capsys, folder, *options):
    """The message about a file that is not imported."""
    assert main(["import", *map(str, options), "-o", str(folder / "a.h5")]) == 2
    return capsys.readouterr().err


def structured():
    array = np.zeros(64, [("t", "f8"), ("v", "f8")])
    array["v"] = READINGS
    return array


def write_h5(path, name="scan/y"):
    with h5py.File(path, "w") as file:
        file[name] = READINGS


def lines(form="{}"):
    return "".join(form.format(reading) + "\n" for reading in READINGS.tolist())


def traces(end=""):
    return "".join(f"{1e-3 * k},{reading}{end}\n" for k, reading in enumerate(READINGS.tolist()))


@pytest.mark.parametrize(
    ("name", "variable", "write"),
    [
        ("a.h5", None, write_h5),
        ("a.hdf5", "scan/y", write_h5),
        ("a.npy", "v", lambda path: np.save(path, structured())),
        ("a.npz", "run.v", lambda path: np.savez(path, run=structured(), t=np.arange(3))),
        ("a.mat", None, lambda path: scipy.io.savemat(path, {"S": {"y": READINGS, "day": "x"}})),
        (
            "a.mat",
            "S.run.y",
            lambda path: scipy.io.savemat(
                path,
                {"S": {"t": np.arange(3.0), "run": {"n": 1, "y": READINGS}}},
                do_compression=True,
            ),
        ),
        ("a.mat", "S.y", lambda path: write_h5(path, "S/y")),
        ("a.txt", None, lambda path: path.write_text(lines("np.float64({})"))),
        ("a.txt", None, lambda path: path.write_text(f"{READINGS.tolist()}\n")),
        ("a.txt", None, lambda path: path.write_text(lines("[{}]"))),
        ("keysight.csv", "Volt", lambda path: path.write_text(KEYSIGHT + traces())),
        ("tektronix.csv", "CH1", lambda path: path.write_text(TEKTRONIX + traces())),
        ("rigol.csv", "Volt", lambda path: path.write_text(RIGOL + traces(",,"))),
    ],
)
def test_readings_are_read_from(tmp_path, name, variable, write):
    write(tmp_path / name)
    np.testing.assert_array_equal(load_array(tmp_path / name, variable).ravel(), READINGS)


def test_settings_in_columns_before_the_trace_do_not_hide_its_first_lines(tmp_path):
    settings = [*OLD_TEKTRONIX, *[",,"] * 61]
    both = zip(settings, traces().splitlines(), strict=True)
    (tmp_path / "old.csv").write_text("".join(f"{one},{two}\n" for one, two in both))
    np.testing.assert_array_equal(load_array(tmp_path / "old.csv", "4"), READINGS)


@pytest.mark.parametrize(
    ("name", "write", "message"),
    [
        ("a.npy", lambda path: np.save(path, structured()), "name one of its variables: t, v"),
        ("a.h5", lambda path: h5py.File(path, "w").close(), r"a\.h5: name one of its variables"),
        (
            "a.mat",
            lambda path: scipy.io.savemat(path, {"S": np.zeros((1, 2), [("y", "f8")])}),
            "S is of class struct, must hold numbers",
        ),
        (
            "a.csv",
            lambda path: path.write_text(TEKTRONIX + traces().replace("0.002", "x")),
            r"line 13 has 'x' in column 0 \(TIME\): name the column of the readings",
        ),
    ],
)
def test_what_cannot_be_read_is_refused_with_a_remedy(tmp_path, name, write, message):
    write(tmp_path / name)
    with pytest.raises(InputError, match=message):
        load_array(tmp_path / name)


def test_structures_within_structures_end(tmp_path):
    nested = {"y": READINGS}
    for _ in range(20):
        nested = {"s": nested}
    scipy.io.savemat(tmp_path / "a.mat", nested)
    with pytest.raises(InputError, match="is of class struct"):
        load_array(tmp_path / "a.mat")


@pytest.mark.parametrize("side", [8, 16])
def test_a_stack_of_patterns_of_zeros_and_ones_as_matlab_keeps_it(tmp_path, capsys, side):
    """The paper's authors keep `M_frame` (H, W, M), all on first, without a dark exposure."""
    image = np.random.default_rng(side).uniform(0, 1, (side, side))
    patterns = ((1 + hadamard(side**2)) // 2).reshape(-1, side, side).astype(np.uint8)
    frame = np.moveaxis(patterns, 0, 2)
    scipy.io.savemat(tmp_path / "frame.mat", {"M_frame": frame})
    readings = {"measurements": (patterns * image).sum(axis=(1, 2))[:, None]}
    scipy.io.savemat(tmp_path / "readings.mat", readings)
    options = [tmp_path / "readings.mat", "--patterns-variable", tmp_path / "frame.mat"]
    options += ["--shape", f"{side}x{side}"]
    assert "state the dark reading with --dark" in refused(capsys, tmp_path, *options)
    capture = imported(tmp_path, *options, "--dark", 0)
    np.testing.assert_allclose(capture.buckets.counts[0], expose(capture.plan, image), atol=1e-9)


def test_a_stack_that_may_lie_either_way_is_refused():
    with pytest.raises(InputError, match=r"may be \(M, H, W\) or \(H, W, M\)"):
        plan_from_matrix(np.ones((8, 8, 8)), (8, 8))


def columns_of(path, frames, spots):
    """Text with time stamp, spot and taps, spot by spot in the given order."""
    rows = [
        f"2024-05-01 12:00:{second:02d},{spot}," + ",".join(map(str, frames[frame, spot]))
        for second, (frame, spot) in enumerate(spots)
    ]
    path.write_text("\n".join(["timestamp,spot,A0,A90,A180,A270", *rows]))


def test_named_columns_of_taps_and_of_their_spot(tmp_path):
    """The k-th line of a spot belongs to frame k, whatever the order of the lines."""
    frames = np.stack([cw_taps(20e6), cw_taps(20e6)[::-1]])
    order = [(0, 2), (0, 0), (1, 2), (0, 1), (0, 3), (1, 1), (1, 0), (1, 3)]
    columns_of(tmp_path / "taps.csv", frames, order)
    taps = ["--taps", tmp_path / "taps.csv", "--frequency", "20e6", *AVAILABLE]
    capture = imported(tmp_path, *taps, "--columns", "A0", "A90", "A180", "5", "spot=spot")
    np.testing.assert_allclose(capture.spots.taps, frames)
    in_lines = imported(tmp_path, *taps, "--columns", "A0", "A90", "A180", "A270")
    np.testing.assert_allclose(
        in_lines.spots.taps.reshape(8, 4), [frames[each] for each in order], rtol=1e-12
    )


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ([], r"name those of the taps \(--columns\)"),
        (["A0", "A90", "A180", "A270", "spot=spot"], r"spot 3 in 1 line\(s\), spot 0 in 2"),
        (["spot=spot"], "--columns must name the columns of the taps"),
        (["A0", "A9", "A180", "A270"], "has no column 'A9': did you mean 'A90'"),
    ],
)
def test_columns_that_are_no_taps_are_refused(tmp_path, capsys, columns, message):
    order = [(0, 0), (0, 1), (0, 2), (0, 3), (0, 0), (0, 1), (0, 2)]
    columns_of(tmp_path / "taps.csv", cw_taps(20e6)[None], order)
    text = (tmp_path / "taps.csv").read_text().splitlines()
    if not columns:
        (tmp_path / "taps.csv").write_text("\n".join(line.partition(",")[2] for line in text))
    columns = ["--columns", *columns] if columns else []
    taps = ["--taps", tmp_path / "taps.csv", "--frequency", "20e6"]
    assert re.search(message, refused(capsys, tmp_path, *taps, *columns))


@pytest.mark.parametrize(
    ("readings", "method"),
    [
        (["--frequency", "20e6"], "cw"),
        (["--windows", "0", "10e-9", "20e-9", "30e-9", "--pulse-width", "10e-9"], "pulsed"),
        (["--bin-width", "1e-9", "--pulses", "100000"], "dtof"),
    ],
)
def test_frames_of_spots_between_two_frames_of_patterns_are_added(tmp_path, readings, method):
    """Five frames have five times the light: the ranges of one, and sigma by the root of five."""
    np.save(tmp_path / "one.npy", np.rint(cw_taps(20e6)))
    np.save(tmp_path / "five.npy", np.tile(np.rint(cw_taps(20e6)), (5, 1, 1)))
    np.save(tmp_path / "patterns.npy", READINGS[:16])
    charge = [] if method == "dtof" else [*AVAILABLE, "--taps-offset-counts", 100]
    shown = [tmp_path / "patterns.npy", "--shape", "4x4", "--order", "natural", *readings, *charge]
    one = imported(tmp_path, *shown, "--taps", tmp_path / "one.npy")
    five = imported(tmp_path, *shown, "--taps", tmp_path / "five.npy")
    assert (one.frames, five.frames) == (1, 1)
    np.testing.assert_allclose(five.spots.readings, 5 * one.spots.readings)
    if method == "cw":
        of_one, of_five = (measure_ranges(each.spots, 0, "cw") for each in (one, five))
        np.testing.assert_allclose(of_five.range_m, of_one.range_m, rtol=1e-9)
        np.testing.assert_allclose(of_one.sigma_m / of_five.sigma_m, np.sqrt(5), rtol=1e-3)


def test_frames_of_spots_that_do_not_divide_are_refused(tmp_path, capsys):
    np.save(tmp_path / "five.npy", np.tile(cw_taps(20e6), (5, 1, 1)))
    np.save(tmp_path / "patterns.npy", np.tile(READINGS[:16], (2, 1)))
    options = ["--shape", "4x4", "--order", "natural", "--frequency", "20e6"]
    options += ["--taps", tmp_path / "five.npy"]
    error = refused(capsys, tmp_path, tmp_path / "patterns.npy", *options)
    assert "5 frame(s) of spots, 2 of patterns" in error
