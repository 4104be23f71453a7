"""Recordings as people have them become the captures that they are: each with a known image."""

import json

import numpy as np
import pytest
import scipy.io
from scipy.linalg import hadamard

from images import correlation, natural_image
from reconstruction import read_capture, reconstruct
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import (
    capture_from_readings,
    load_array,
    plan_from_factors,
    plan_from_rows,
    read_about,
    readings_of,
)
from reconstruction.cli import main
from reconstruction.cli.importing import _frames
from reconstruction.operators import expose, make_plan, ordered_rows, sequency
from reconstruction.operators.bases.hadamard import Hadamard
from spisim_formats.recordings.spas import whole_numbers

SHAPE = (8, 16)
IMAGE = natural_image(16, 1)[:8]
NATURAL = expose(make_plan(SHAPE, order="natural", polarity="signed"), IMAGE)


def imported(folder, file, *options, shape=SHAPE):
    """The zero-filled image of a file, imported with these options."""
    arguments = ["import", str(folder / file), "-o", str(folder / "a.h5"), "--overwrite"]
    if shape is not None:
        arguments += ["--shape", f"{shape[0]}x{shape[1]}"]
    assert main([*arguments, *options]) == 0
    return reconstruct(read_capture(folder / "a.h5"), image="zero-filled").image


def refused(capsys, folder, file, *options):
    """What is said of a file that is not imported."""
    arguments = ["import", str(folder / file), "-o", str(folder / "a.h5"), "--shape", "8x16"]
    assert main([*arguments, *options]) == 2
    return capsys.readouterr().err


TEXTS = {
    "comma.csv": "1.5,2,-3e1\n4,5,6\n",
    "semicolon.csv": "1,5;2;-3e1\n4;5;6\n",
    "tab.tsv": "1,5\t2\t-30\n4\t5\t6\n",
    "spaces.dat": "  1.5   2  -3e1\n  4 5 6  \n\n",
    "decimal commas.txt": "1,5 2,0 -30,0\n4,0 5,0 6,0\n",
    "headed.csv": "time of day; 2026\na;b;c\n1,5;2;-30\n4;5;6\n",
    "quoted.csv": '# rig 7\n"a","b","c"\n1.5,2,-30 # first\n% dark\n// next\n4,5,6\n',
    "byte order mark.csv": "\ufeffa,b,c\r\n1.5,2,-30\r\n4,5,6\r\n",
    "all quoted.csv": '"a","b","c"\n"1.5","2","-30"\n"4","5","6"\n',
    "fortran.dat": " 0.15D+01 2 -3.D1\n 4.D0 5 6\n",
}


@pytest.mark.parametrize("name", TEXTS)
def test_texts_of_all_kinds_hold_the_same_numbers(tmp_path, name):
    (tmp_path / name).write_text(TEXTS[name], encoding="utf-8")
    np.testing.assert_array_equal(load_array(tmp_path / name), [[1.5, 2, -30], [4, 5, 6]])
    np.testing.assert_array_equal(load_array(tmp_path / name, "1"), [2, 5])


def test_columns_are_chosen_by_name_and_may_stand_beside_words(tmp_path):
    (tmp_path / "a.csv").write_text("at;counts;note\n12:00:01;5;ok\n12:00:02;6;dim\n")
    np.testing.assert_array_equal(load_array(tmp_path / "a.csv", "counts"), [5, 6])
    with pytest.raises(InputError, match=r"no column 'count': did you mean 'counts'"):
        load_array(tmp_path / "a.csv", "count")
    with pytest.raises(InputError, match=r"line 2 has '12:00:01' in column 0 \(at\): name the"):
        load_array(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2\n3\n", "line 2 has 1, line 1 2"),
        ("1\nx\n", "line 2 has 'x' in column 0"),
        ("a,b\nc,d\n", "should hold numbers"),
        ("1,,3\n", "line 1 has '' in column 1"),
        ("=1+1\n", "should hold numbers"),
        ("1\n2\n3,4\n", "line 3 has '3,4' in column 0"),
        ("1063,70\n1026,07\n", r"line 1 has '1063,70': one number or two columns\?"),
        ("volts\n1,5\n2,0\n", "line 2 has '1,5': one number or two columns"),
        ("# nothing\n\n", "holds no numbers"),
    ],
)
def test_texts_without_numbers_are_refused_by_line(tmp_path, text, message):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        load_array(tmp_path / "a.csv")


def test_texts_may_be_of_sixteen_bits_and_headings_of_combining_letters(tmp_path):
    (tmp_path / "a.txt").write_text("Za\u0308hler\tn\n5\t0\n6\t1\n", encoding="utf-16")
    np.testing.assert_array_equal(load_array(tmp_path / "a.txt", "Z\u00e4hler"), [5, 6])


@pytest.mark.parametrize("shape", [(6,), (1, 6), (6, 1), (2, 3), (4, 6), (6, 4)])
def test_readings_come_in_rows_or_columns(shape):
    frames = np.arange(24).reshape(4, 6) ** 2
    counts = (
        frames.T if shape == (6, 4) else frames if shape == (4, 6) else frames[0].reshape(shape)
    )
    np.testing.assert_array_equal(readings_of(counts, 6), frames[: 4 if 4 in shape else 1])


def test_rows_are_counted_in_any_order_from_0_or_1(tmp_path, capsys):
    rng = np.random.default_rng(2)
    displayed = rng.permutation(128)
    rows = ordered_rows(Hadamard(SHAPE), "sequency-2d")[displayed]
    np.savez(tmp_path / "a.npz", counts=NATURAL[rows], rows=displayed, matlab=displayed + 1)
    named = ["--variable", "counts", "--order", "sequency-2d", "--rows"]
    np.testing.assert_allclose(imported(tmp_path, "a.npz", *named, "rows"), IMAGE, atol=1e-5)
    result = imported(tmp_path, "a.npz", *named, "matlab", "--first-row", "1")
    np.testing.assert_allclose(result, IMAGE, atol=1e-5)
    assert "--rows go from 1 to 128: add --first-row 1" in refused(
        capsys, tmp_path, "a.npz", *named, "matlab"
    )


def test_row_numbers_and_signs_in_columns_of_a_text(tmp_path):
    rows = np.repeat(np.arange(128), 2)
    signs = np.where(np.arange(256) % 2, 1, -1)
    counts = 100 + (IMAGE.sum() + signs * NATURAL[rows]) / 2
    lines = (
        f"{row};{sign};{count:.9f}" for row, sign, count in zip(rows, signs, counts, strict=True)
    )
    (tmp_path / "a.txt").write_text("row;sign;counts\n" + "\n".join(lines))
    options = ["--variable", "counts", "--rows", "row", "--signs", "sign"]
    np.testing.assert_allclose(imported(tmp_path, "a.txt", *options), IMAGE, atol=1e-5)


@pytest.mark.parametrize("polarity", ["negative-first", "halves"])
def test_sequences_of_polarities(tmp_path, polarity):
    plan = make_plan(SHAPE, order="natural", polarity=polarity)
    np.save(tmp_path / "a.npy", expose(plan, IMAGE) + 50)
    options = ["--polarity", polarity]
    np.testing.assert_allclose(imported(tmp_path, "a.npy", *options), IMAGE, atol=1e-5)


def test_a_dark_reading_that_was_not_recorded_is_told(tmp_path, capsys):
    plan = make_plan(SHAPE, order="natural", polarity="single-ended")
    np.save(tmp_path / "a.npy", expose(plan, IMAGE)[:-1] + 50)
    result = imported(tmp_path, "a.npy", "--polarity", "single-ended", "--dark", "50")
    assert np.corrcoef(result.ravel(), IMAGE.ravel())[0, 1] > 0.99
    rows = np.arange(128)
    np.savez(tmp_path / "b.npz", counts=NATURAL, rows=rows, signs=np.ones(128))
    reported = refused(
        capsys, tmp_path, "b.npz", "--variable", "counts", "--rows", "rows", "--signs", "signs"
    )
    assert "the background cannot be removed from pattern index" in reported


def test_pixels_numbered_by_columns(tmp_path):
    """As MATLAB has them: patterns of H x W reshaped from vectors of their columns."""
    rows = hadamard(128)
    counts = rows @ IMAGE.ravel(order="F")
    scipy.io.savemat(tmp_path / "a.mat", {"y": counts, "p": rows})
    named = ["--variable", "y", "--transposed"]
    np.testing.assert_allclose(imported(tmp_path, "a.mat", *named), IMAGE, atol=1e-5)
    given = [*named, "--patterns-variable", "p"]
    np.testing.assert_allclose(imported(tmp_path, "a.mat", *given), IMAGE, atol=1e-5)
    random = np.random.default_rng(3).random((200, 128))
    scipy.io.savemat(tmp_path / "b.mat", {"y": random @ IMAGE.ravel(order="F"), "p": random})
    np.testing.assert_allclose(imported(tmp_path, "b.mat", *given), IMAGE, atol=1e-3)


def test_separable_patterns(tmp_path):
    tall, wide = hadamard(8)[::-1], -hadamard(16)
    np.savez(tmp_path / "a.npz", y=tall @ IMAGE @ wide.T, down=tall, along=wide)
    options = ["--variable", "y", "--factors", "down,along"]
    np.testing.assert_allclose(imported(tmp_path, "a.npz", *options), IMAGE, atol=1e-5)
    plan, _ = plan_from_factors(tall[:3], wide[:5])
    assert (plan.basis, plan.exposures) == ("hadamard", 15)


def test_separable_patterns_of_any_kind(tmp_path):
    rng = np.random.default_rng(4)
    tall, wide = rng.random((12, 8)), rng.random((20, 16))
    np.savez(tmp_path / "a.npz", y=tall @ IMAGE @ wide.T, down=tall, along=wide)
    options = ["--variable", "y", "--factors", "down,along"]
    np.testing.assert_allclose(imported(tmp_path, "a.npz", *options), IMAGE, atol=2e-2)


@pytest.mark.parametrize("steps", [3, 4])
@pytest.mark.parametrize("by_steps", [True, False])
def test_phase_steps_of_fourier_patterns(tmp_path, steps, by_steps):
    height, width = SHAPE
    down, along = np.divmod(np.arange(128), width)
    angle = (
        2
        * np.pi
        * (
            down[:, None, None] * np.arange(height)[:, None] / height
            + along[:, None, None] * np.arange(width) / width
        )
    )
    phases = 2 * np.pi / steps * np.arange(steps)
    counts = np.stack([((1 + np.cos(angle + p)) / 2 * IMAGE).sum((1, 2)) for p in phases], axis=1)
    counts = counts if by_steps else counts.T
    np.savez(tmp_path / "a.npz", y=counts + 9, f=np.stack([down, along], axis=1))
    options = ["--variable", "y", "--frequencies", "f", "--phase-steps", str(steps)]
    np.testing.assert_allclose(imported(tmp_path, "a.npz", *options), IMAGE, atol=1e-3)


def test_complex_fourier_coefficients(tmp_path, capsys):
    spectrum = np.fft.fft2(IMAGE)
    for name, values in {"first": spectrum, "middle": np.fft.fftshift(spectrum)}.items():
        np.save(tmp_path / f"{name}.npy", values)
        np.testing.assert_allclose(imported(tmp_path, f"{name}.npy"), IMAGE, atol=1e-4)
    low = np.array([[0, 0], [0, 1], [1, 0], [-1, 1], [2, 2]])
    np.savez(tmp_path / "some.npz", y=spectrum[low[:, 0], low[:, 1]], f=low)
    result = imported(tmp_path, "some.npz", "--variable", "y", "--frequencies", "f")
    retained = np.zeros(SHAPE)
    retained[low[:, 0], low[:, 1]] = retained[-low[:, 0], -low[:, 1]] = 1
    np.testing.assert_allclose(result, np.fft.ifft2(spectrum * retained).real, atol=1e-4)
    np.save(tmp_path / "moved.npy", np.roll(spectrum, 1))
    assert "[0, 1], must be at [0, 0] or [4, 8]" in refused(capsys, tmp_path, "moved.npy")


def spas(folder, numbers, counts, **changes):
    """Files as SPAS writes them: spectra of three wavelengths, the first of which is dark."""
    spectra = np.stack([np.full(len(counts), 7.0), counts, 2 * counts], axis=1)
    np.savez(folder / "cat_spectraldata.npz", spectral_data=spectra)
    acquisition = {
        "pattern_dimension_x": 16,
        "pattern_dimension_y": 8,
        "mask_index": "[]",
        "mean_spectrometer_acquisition_time_ms": 1.25,
        "patterns": str(numbers),
        "wavelengths": "[530.0000, 540.5000, 551.0000]",
        "class_description": "Acquisition parameters",
    }
    objects = [
        {"pattern_prefix": "Walsh_8x16", "class_description": "Metadata"},
        {"integration_time_ms": 1.0, "class_description": "Spectrometer parameters"},
        acquisition | changes,
    ]
    (folder / "cat_metadata.json").write_text(json.dumps(objects))


def walsh_counts(numbers):
    """Readings of positive (even) and negative (odd) parts of products of Walsh functions."""
    walsh = [hadamard(side)[np.argsort(sequency(side))] for side in SHAPE]
    rows = np.kron(*walsh)[np.array(numbers) // 2]
    sign = np.where(np.array(numbers) % 2, -1, 1)
    return 100 + ((rows * sign[:, None] > 0) * IMAGE.ravel()).sum(axis=1)


@pytest.mark.parametrize("written", [str, lambda n: [f"np.int32({k})" for k in n]])
def test_recordings_of_spas(tmp_path, written):
    order = np.random.default_rng(5).permutation(128)
    numbers = np.stack([2 * order, 2 * order + 1], axis=1).ravel().tolist()
    spas(tmp_path, str(written(numbers)).replace("'", ""), walsh_counts(numbers))
    result = imported(tmp_path, "cat_spectraldata.npz", shape=None)
    np.testing.assert_allclose(result, 3 * IMAGE, atol=1e-4)
    buckets = read_capture(tmp_path / "a.h5").buckets
    assert (buckets.exposure_time_s, buckets.pattern_period_s) == (1e-3, 1.25e-3)
    band = imported(tmp_path, "cat_spectraldata.npz", "--band-nm", "540-550", shape=None)
    np.testing.assert_allclose(band, IMAGE, atol=1e-4)


@pytest.mark.parametrize(
    "patterns",
    [
        "__import__('os').system('touch owned')",
        "[0, 1, __import__('os')]",
        "[[0, 1]]",
        "[0.0, 1.0]",
        "[0, -1]",
        "[0, 1",
        "[" * 100_000,
        "[1e3]",
        "[99999999999999999999]",
        "[True]",
        "",
        None,
        {"a": 1},
        [0, True],
        7,
    ],
)
def test_what_is_no_list_of_whole_numbers_is_never_evaluated(patterns):
    with pytest.raises(InputError, match=r"^patterns is .{1,60}, must be a list of whole numbers"):
        whole_numbers(patterns, "patterns")


def test_lists_of_whole_numbers():
    for value in ("[0, 7,12]", "[np.int32(0), np.uint16(7), 12]", [0, 7, 12]):
        np.testing.assert_array_equal(whole_numbers(value, "patterns"), [0, 7, 12])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"patterns": "[0, 1, 256]"}, "patterns holds 256, outside 0..255 for 8 x 16"),
        ({"patterns": "__import__('os')"}, "must be a list of whole numbers"),
        ({"mask_index": "[3.0000]"}, "mask_index is not empty"),
        ({"pattern_dimension_x": "16"}, "pattern_dimension_x is '16', must be a whole number"),
        ({"class_description": "x"}, "has no object of class_description 'Acquisition parameters'"),
    ],
)
def test_metadata_of_spas_that_cannot_be(tmp_path, capsys, changes, message):
    spas(tmp_path, [0, 1], np.ones(2), **changes)
    assert message in refused(capsys, tmp_path, "cat_spectraldata.npz")


def test_files_of_spas_that_cannot_be(tmp_path, capsys):
    spas(tmp_path, [0, 1, 2, 3], np.ones(6))
    assert "shape (6, 3), the metadata 4 patterns" in refused(
        capsys, tmp_path, "cat_spectraldata.npz"
    )
    band = refused(capsys, tmp_path, "cat_spectraldata.npz", "--band-nm", "700-800")
    assert "no wavelength lies in 700..800 nm; there are 530..551" in band
    path = tmp_path / "cat_metadata.json"
    for text, message in {
        path.read_text().replace("Walsh", "Raster"): "pattern_prefix is 'Raster_8x16'",
        "{}": "should hold a list of objects",
        "[" * 100_000: "not readable as JSON",
    }.items():
        path.write_text(text)
        assert message in refused(capsys, tmp_path, "cat_spectraldata.npz")
    path.unlink()
    assert "no such file; SPAS writes it" in refused(capsys, tmp_path, "cat_spectraldata.npz")


def test_what_is_known_of_the_detector(tmp_path):
    np.save(tmp_path / "a.npy", NATURAL)
    (tmp_path / "rig.yaml").write_text(
        "# my rig\nelectrons_per_count: 12.5  # gain 2\n\nnoise_electrons: 40\n"
    )
    options = ["--about", str(tmp_path / "rig.yaml"), "--noise-electrons", "50"]
    imported(tmp_path, "a.npy", *options, "--exposure-time-s", "6e-5")
    buckets = read_capture(tmp_path / "a.h5").buckets
    assert (buckets.electrons_per_count, buckets.noise_electrons) == (12.5, 50)
    assert (buckets.exposure_time_s, buckets.unit) == (6e-5, "electron")
    direct = capture_from_readings(
        NATURAL, make_plan(SHAPE, order="natural", polarity="signed"), about={"offset_counts": 3.0}
    )
    assert direct.buckets.offset_counts == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "electrons_per_counts: 1",
            "unknown detector property 'electrons_per_counts': did you mean 'electrons_per",
        ),
        ("noise_electrons: [1, 2]", r"noise_electrons is '\[1, 2\]', must be a number"),
        ("noise", "'noise' is not of the form name: number"),
        ("a: &a [*a]", "must be a number"),
    ],
)
def test_what_is_told_of_the_detector_must_be_numbers(tmp_path, text, message):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        read_about(tmp_path / "a.yaml")


def test_rows_are_whole_numbers():
    for rows in ([0.5], ["a"]):
        with pytest.raises(InputError, match="the row numbers must be whole numbers"):
            plan_from_rows(rows, SHAPE)
    with pytest.raises(InputError, match="unknown polarity 'both'"):
        plan_from_rows([1], SHAPE, polarity="both")
    with pytest.raises(InputError, match="polarity must be -1, 0 or"):
        plan_from_rows([1, 2], SHAPE, polarity=[1])


def test_auto_finds_the_layout_and_says_how_sure_it_is(tmp_path, capsys):
    image = natural_image(32, 7)
    plan = make_plan((32, 32), 512, "sequency", "halves")
    np.save(tmp_path / "a.npy", expose(plan, image).reshape(1, -1).T + 200)
    result = imported(tmp_path, "a.npy", "--order", "auto", shape=(32, 32))
    messages = capsys.readouterr().out
    assert messages.startswith("order sequency, polarity halves: ")
    assert correlation(result, image) > 0.9


def test_an_image_on_its_side_is_turned(tmp_path):
    image = natural_image(32, 8)
    np.save(tmp_path / "a.npy", expose(make_plan((32, 32), None, "natural", "signed"), image))
    result = imported(tmp_path, "a.npy", "--order", "auto", "--transposed", shape=(32, 32))
    np.testing.assert_allclose(result, image.T, atol=1e-4)


def test_polarities_that_nobody_knows_are_refused_in_auto_too(tmp_path, capsys):
    np.save(tmp_path / "a.npy", NATURAL)
    assert "unknown polarity 'both'" in refused(
        capsys, tmp_path, "a.npy", "--order", "auto", "--polarity", "both"
    )


def test_a_text_about_the_detector_is_short(tmp_path):
    (tmp_path / "a.yaml").write_text("noise: 1\n" * 10_000)
    with pytest.raises(InputError, match=r"a\.yaml.*more than 64 KiB; expected a few lines"):
        read_about(tmp_path / "a.yaml")


def test_patterns_of_other_sides_than_stated_are_refused(tmp_path, capsys):
    tall, wide = hadamard(16), hadamard(8)
    np.savez(tmp_path / "a.npz", y=tall @ IMAGE.T @ wide, down=tall, along=wide)
    message = refused(capsys, tmp_path, "a.npz", "--variable", "y", "--factors", "down,along")
    assert "the patterns have 16 x 8 pixels, not the 8 x 16 of --shape" in message


def test_the_longer_axis_is_that_of_the_readings_of_a_frame():
    """Unless the array is an image of readings, or has a single frame."""
    frames = np.random.default_rng(3).random((3, 10))
    np.testing.assert_array_equal(_frames(frames, SHAPE), frames)
    np.testing.assert_array_equal(_frames(frames.T, SHAPE), frames)
    for single in (frames[:1], frames[:1].T, frames[0]):
        np.testing.assert_array_equal(_frames(single, SHAPE), frames[:1])
    assert _frames(np.ones(SHAPE), SHAPE).shape == (1, 128)
