"""Taps, windows and histograms as people have them become captures with the ranges they tell."""

import re

import numpy as np
import pytest
import scipy.io

from reconstruction import make_plan, read_capture, reconstruct, write_capture
from reconstruction.base.constants import c
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import (
    SpotGeometry,
    capture_from_readings,
    capture_from_spots,
    spots_from_taps,
)
from reconstruction.cli import main

RANGES_M = np.array([1.0, 2.5, 4.0, 6.0])
AMPLITUDE, OFFSET, NOISE = 4000.0, 9000.0, 30.0


def cw_taps(*frequencies_hz):
    """Taps (4, K) in electrons, four phases of each frequency in turn."""
    phases = np.arange(4) * np.pi / 2
    of_each = [
        OFFSET + AMPLITUDE * np.cos((4 * np.pi * f / c * RANGES_M)[:, None] - phases)
        for f in frequencies_hz
    ]
    return np.concatenate(of_each, axis=1)


def imported(folder, *options):
    """The capture that a file becomes."""
    assert main(["import", *map(str, options), "-o", str(folder / "a.h5"), "--overwrite"]) == 0
    return read_capture(folder / "a.h5")


def refused(capsys, folder, *options):
    """What is said of a file that is not imported."""
    assert main(["import", *map(str, options), "-o", str(folder / "a.h5")]) == 2
    assert not (folder / "a.h5").exists()
    return capsys.readouterr().err


def ranges_of(capture, frame=0):
    return reconstruct(capture, frame, image="zero-filled").rangings[capture.spots.method]


AVAILABLE = ["--taps-electrons-per-count", 2, "--taps-noise-electrons", NOISE]


@pytest.mark.parametrize("layout", [(4, 4), (1, 16), (3, 16), (12, 4), (3, 4, 4)])
def test_taps_in_any_layout_have_their_ranges_with_the_sigma_of_the_closed_form(tmp_path, layout):
    frames = np.tile(cw_taps(20e6) / 2, (int(np.prod(layout)) // 16, 1, 1))
    np.save(tmp_path / "taps.npy", frames.reshape(layout))
    taps = ["--taps", tmp_path / "taps.npy", "--frequency", "20e6", *AVAILABLE]
    capture = imported(tmp_path, *taps)
    assert capture.frames == len(frames)
    ranges = ranges_of(capture, capture.frames - 1)
    sigma_m = c / (4 * np.pi * 20e6) * np.sqrt((OFFSET + NOISE**2) / 2) / AMPLITUDE
    assert ranges.range_m == pytest.approx(RANGES_M, abs=1e-9)
    assert ranges.sigma_m == pytest.approx(sigma_m, rel=1e-9)


def test_a_text_of_taps_alone_is_a_capture_without_an_image(tmp_path, capsys):
    np.savetxt(tmp_path / "taps.csv", cw_taps(20e6), delimiter=",", header="0,90,180,270")
    imported(tmp_path, "--taps", tmp_path / "taps.csv", "--frequency", "20e6")
    reported = capsys.readouterr()
    assert "1 frame(s) of continuous wave, 4 taps, 20 MHz" in reported.out
    assert "directions are not stated" in reported.err
    assert "electrons_per_count of the taps is not stated" in reported.err
    assert main([str(tmp_path / "a.h5"), "-o", str(tmp_path / "result")]) == 0
    assert "ranges alone, hardware" in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "result").iterdir()] == ["result.h5"]


def test_several_frequencies_with_phases_and_calibration_of_their_own(tmp_path):
    phases_deg, offsets_deg = np.array([10, 130, 250]), np.array([5.0, -20.0])
    frequencies_hz = np.array([60e6, 80e6])
    turned = 4 * np.pi * frequencies_hz / c * RANGES_M[:, None] + np.radians(offsets_deg)
    taps = OFFSET + AMPLITUDE * np.cos(turned[..., None] - np.radians(phases_deg))
    scipy.io.savemat(tmp_path / "rig.mat", {"taps": taps.reshape(4, 6), "other": np.zeros(3)})
    capture = imported(
        tmp_path,
        *("--taps", f"{tmp_path / 'rig.mat'}:taps", "--frequency", "60e6", "80e6"),
        *("--phases-deg", *phases_deg, "--phase-offsets-deg", *offsets_deg, *AVAILABLE[:1], 1),
        *AVAILABLE[2:],
    )
    assert ranges_of(capture).range_m == pytest.approx(RANGES_M, abs=1e-6)


def test_windows_of_pulses(tmp_path):
    width_s, starts_s = 40e-9, np.array([-50e-9, 0, 40e-9, 80e-9])
    arrival_s = 2 * RANGES_M / c + 3e-9
    inside = np.maximum(1 - np.abs(starts_s - arrival_s[:, None]) / width_s, 0)
    np.savetxt(tmp_path / "w.csv", 500 + 8000 * inside, delimiter=",")
    capture = imported(
        tmp_path,
        *("--taps", tmp_path / "w.csv", "--windows", *starts_s, "--pulse-width", width_s),
        *("--pulses", 100, "--delay-offset", 3e-9, "--taps-noise-electrons", 10),
    )
    assert capture.spots.pulses == 100
    assert ranges_of(capture).range_m == pytest.approx(RANGES_M, abs=1e-6)


@pytest.mark.parametrize("by_columns", [True, False])
def test_histograms_with_bins_down_or_across(tmp_path, by_columns):
    edges_s = 1e-9 * np.arange(61)
    rng = np.random.default_rng(0)
    arrivals = [rng.normal(2 * range_m / c, 0.5e-9, 4000) for range_m in RANGES_M]
    counts = np.array([np.histogram(each, edges_s)[0] for each in arrivals])
    np.savetxt(tmp_path / "h.csv", counts.T if by_columns else counts, fmt="%d", delimiter=",")
    histograms = ["--taps", tmp_path / "h.csv", "--bin-width", 1e-9, "--pulses", 1000000]
    ranges = ranges_of(imported(tmp_path, *histograms, "--response-sigma", 0.5e-9))
    assert ranges.range_m == pytest.approx(RANGES_M, abs=0.01)
    assert (np.abs(ranges.range_m - RANGES_M) < 5 * ranges.sigma_m).all()


def test_taps_beside_readings_of_patterns(tmp_path):
    readings = np.random.default_rng(0).poisson(900, (2, 128))
    directions = np.array([[-2, 0, 9], [2, 0, 9], [0, -2, 9], [0, 2, 9.0]])
    taps = np.stack([cw_taps(20e6), cw_taps(20e6)])
    np.savez(tmp_path / "rig.npz", readings=readings, taps=taps, at=directions)
    capture = imported(
        tmp_path,
        *(tmp_path / "rig.npz", "--variable", "readings", "--shape", "8x8"),
        *("--polarity", "differential", "--taps", "taps", "--frequency", "20e6"),
        *("--directions", "at", "--fov-deg", "60x40", *AVAILABLE),
    )
    assert capture.frames == 2
    assert capture.optics.tan_half_width == pytest.approx(np.tan(np.radians(30)))
    assert capture.optics.tan_half_height == pytest.approx(np.tan(np.radians(20)))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    assert capture.spots.directions == pytest.approx(unit)
    assert reconstruct(capture).depth_m is not None


def test_saturated_taps_are_not_used(tmp_path):
    np.save(tmp_path / "t.npy", cw_taps(20e6).round().astype(int))
    taps = ["--taps", tmp_path / "t.npy", "--frequency", "20e6"]
    maximum = int(cw_taps(20e6)[2].max())
    (tmp_path / "about.yaml").write_text(f"saturation_counts: {maximum}\n")
    capture = imported(tmp_path, *taps, "--taps-about", tmp_path / "about.yaml")
    assert ranges_of(capture).status[2] == "saturated"
    assert set(imported(tmp_path, *taps).spots.saturated.ravel()) == {False}


@pytest.mark.parametrize("shape", [(4, 4), (100, 16)])
def test_numbers_that_may_be_taps_are_asked_about(tmp_path, capsys, shape):
    file = tmp_path / "t.csv"
    np.savetxt(file, np.random.default_rng(0).poisson(900, shape), delimiter=",")
    reported = refused(capsys, tmp_path, file, "--shape", "4x4")
    assert "taps of four spots, or readings of 4 x 4 patterns?" in reported
    assert "--taps" in reported
    capture = imported(tmp_path, file, "--shape", "4x4", "--order", "natural")
    assert capture.spots is None


CW = ("--frequency", "20e6")
PULSED = ("--windows", "0", "1e-8", "2e-8", "3e-8", "--pulse-width")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--frequency", "20"), "20 Hz is below the minimum of 10000 Hz.* in MHz, write 20e6"),
        (("--frequency", "20e6", "30e6"), r"shape \(4, 4\); 4 phases of 2 .* 8 columns.* or 32"),
        ((*CW, "--phases-deg", "0", "90", "180"), "3 columns, a line for each spot"),
        ((*CW, "--phases-deg", "0", "0", "180", "180"), "fewer than 3 different phases"),
        ((*CW, "--phase-offsets-deg", "0", "1"), "--phase-offsets-deg has 2 numbers"),
        ((*CW, "--pulse-width", "1e-8"), "--pulse-width needs --windows"),
        ((*CW, "--taps-electrons-per-count", "0"), "electrons_per_count is 0.0, must be positive"),
        ((*CW, "--fov-deg", "60x40"), "--fov-deg needs --directions"),
        ((*PULSED, "2e-8"), "window 2 must start .*: they overlap"),
        ((*PULSED, "5e-9"), "window 2 must start .*: they leave a gap"),
        ((*PULSED, "10"), "pulse_width_s is 10 s.* in nanoseconds, write 10e-9"),
        (PULSED[:-1], "--windows needs --pulse-width"),
        (("--bin-width", "1", "--pulses", "9"), "bin_width_s is 1 s.* in nanoseconds, write 1e-9"),
        (("--bin-width", "1e-9"), "--bin-width needs --pulses"),
        ((), "--taps needs --frequency or --windows or --bin-width"),
    ],
)
def test_taps_that_cannot_be_are_refused(tmp_path, capsys, options, message):
    np.savetxt(tmp_path / "t.csv", 1.0 + np.arange(16).reshape(4, 4), delimiter=",")
    reported = refused(capsys, tmp_path, "--taps", tmp_path / "t.csv", *options)
    assert re.search(message, reported), reported


def test_options_of_spots_need_taps(tmp_path, capsys):
    assert "--frequency needs --taps" in refused(capsys, tmp_path, *CW)
    assert "FILE is missing" in refused(capsys, tmp_path)


def test_spots_from_python(tmp_path):
    spots = spots_from_taps(cw_taps(20e6), 20e6, about={"noise_electrons": NOISE})
    assert ranges_of(capture_from_spots(spots)).range_m == pytest.approx(RANGES_M)
    plan = make_plan((8, 8), polarity="signed")
    capture = capture_from_readings(np.arange(64), plan, spots=spots)
    assert ranges_of(capture).range_m == pytest.approx(RANGES_M)
    with pytest.raises(InputError, match=r"spots/taps has shape .*frames = 2"):
        capture_from_readings(np.zeros((2, 64)), plan, spots=spots)
    with pytest.raises(
        InputError,
        match=r"unknown detector property 'noise_electron'.* did you mean 'noise_electrons'",
    ):
        spots_from_taps(cw_taps(20e6), 20e6, about={"noise_electron": 1})
    with pytest.raises(InputError, match=r"directions have shape \(3,\), expected \(S, 3\)"):
        spots_from_taps(cw_taps(20e6), 20e6, geometry=SpotGeometry([0, 0, 1]))


@pytest.mark.parametrize("count", [1, 7, 64])
def test_as_many_spots_as_there_are_directions(tmp_path, count):
    geometry = SpotGeometry([[0.01 * each, 0, 1] for each in range(count)])
    taps = np.random.default_rng(count).poisson(900, (5, count, 4))
    spots = spots_from_taps(taps.reshape(5, -1), 20e6, geometry=geometry)
    np.testing.assert_array_equal(spots.taps, taps)
    assert spots.directions.shape == spots.detector_positions_m.shape == (count, 3)
    write_capture(capture_from_spots(spots), tmp_path / "rig.h5")
    np.testing.assert_array_equal(read_capture(tmp_path / "rig.h5").spots.taps, taps)
    with pytest.raises(InputError, match=rf"4 numbers of each of the {count} spots"):
        spots_from_taps(taps[..., :3], 20e6, geometry=geometry)


def test_more_spots_than_there_may_be_are_refused():
    with pytest.raises(InputError, match=r"shape \(65, 3\), expected .* 1 to 64 spots"):
        spots_from_taps(np.ones((65, 4)), 20e6, geometry=SpotGeometry(np.ones((65, 3))))
