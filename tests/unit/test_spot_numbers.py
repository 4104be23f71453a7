"""Recordings of one spot to 64: ranges, depth maps, and what is refused."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fogs import light
from hdf5files import changed
from instruments import WINDOWS, of_spots, some_of
from reconstruction import Capture, Reconstructor, read_result, reconstruct
from reconstruction.base.errors import InputError
from reconstruction.capture import Spots
from reconstruction.capture.schema import between
from reconstruction.checks import checked_ranges
from reconstruction.depth.kriging import anchored_depth, fitted_prior
from reconstruction.outputs.result_file import result_bytes
from reconstruction.ranging import Ranges, brightness_at, range_consistency, ranging_method
from reconstruction.ranging.fog.offsets import measure_path_offsets, min_significance

FOG = {"extinction_per_m": 0.06, "backscatter_per_sr": 0.03}
PRESETS = {"cw": "fog", "pulsed": "hybrid", "dtof": "fog-spad"}
NUMBERS = (1, 3, 9, 16, 64)
CHANGES = {"cw": {}, "pulsed": WINDOWS, "dtof": {"tof__bins": 550}}


def ranges_of(spots: int) -> np.ndarray:
    """True ranges, in no order."""
    return np.random.default_rng(spots).uniform(3.0, 7.0, spots)


@cache
def recorded(method: str, spots: int, frames: int = 1, **fog: float) -> Spots:
    instrument = of_spots(PRESETS[method], spots, **CHANGES[method])
    steady = 2e4 if method == "dtof" else 1e8
    given = light(instrument, ranges_of(spots), frames=frames, steady_per_s=steady, **fog)
    return instrument.tof.record(given, instrument.spot_optics, np.random.default_rng(1))


def ranged(spots: Spots, method: str, frame: int = 0) -> Ranges:
    solve = ranging_method(method, spots).compile(between(spots, 0, 0))
    return solve(between(spots, frame, frame + 1))


@pytest.mark.parametrize("spots", NUMBERS)
@pytest.mark.parametrize("method", PRESETS)
def test_plain_ranges_of_any_number_of_spots_scatter_as_sigma_says(method, spots) -> None:
    result = ranged(recorded(method, spots), method)
    assert result.range_m.shape == result.sigma_m.shape == (spots,)
    assert result.valid.mean() > 0.7  # a pulse may lie outside two windows
    z = ((result.range_m - ranges_of(spots)) / result.sigma_m)[result.valid]
    if method != "pulsed":  # rounded edges of pulses bend its ranges
        assert np.abs(z).max() < 4.5
    else:
        assert np.abs(result.range_m - ranges_of(spots))[result.valid].max() < 0.1


@pytest.mark.parametrize(
    ("method", "spots"),
    [("cw", 1), ("cw", 16), ("cw", 64), ("pulsed", 3), ("pulsed", 9), ("dtof", 1), ("dtof", 9)],
)
def test_ranges_in_fog_of_any_number_of_spots_scatter_as_sigma_says(method, spots) -> None:
    result = ranged(recorded(method, spots, **FOG), "fog")
    assert result.range_m.shape == (spots,)
    assert result.status.count("ok") > 0.9 * spots, result.status
    z = ((result.range_m - ranges_of(spots)) / result.sigma_m)[result.valid]
    assert np.abs(z).max() < 4.5
    assert (z**2).mean() < 1 + 4 * np.sqrt(2 / z.size)


def test_spots_of_a_frame_share_their_fog() -> None:
    """The order of the spots means nothing, and sixteen know the fog better than one of them."""
    spots = recorded("cw", 16, **FOG)
    order = np.random.default_rng(0).permutation(16).tolist()
    result, shuffled, alone = (
        ranged(each, "fog") for each in (spots, some_of(spots, order), some_of(spots, [0]))
    )
    np.testing.assert_allclose(shuffled.range_m, result.range_m[order], rtol=1e-9)
    np.testing.assert_allclose(shuffled.sigma_m, result.sigma_m[order], rtol=1e-6)
    assert result.fog is not None
    assert alone.fog is not None
    assert result.fog.log_sigma < 0.7 * alone.fog.log_sigma
    assert result.sigma_m[0] < alone.sigma_m[0]


def test_one_frequency_and_many_spots_are_as_sure_as_they_are_right() -> None:
    """The grid of fogs and the priors are wrong for all spots alike, however many there are."""
    spots, instrument = 64, of_spots("paper", 64)
    rng = np.random.default_rng(1)
    z = []
    solve = None
    for extinction in (0.02, 0.12):
        true_m = rng.uniform(2, 7, spots)
        given = light(
            instrument,
            true_m,
            reflectances=np.clip(rng.lognormal(np.log(0.27), 0.6, spots), 0.03, 0.9),
            extinction_per_m=extinction,
            backscatter_per_sr=0.035 * np.exp(0.5 * rng.normal()),
        )
        read = instrument.tof.record(given, instrument.spot_optics, rng)
        solve = solve or ranging_method("fog", read).compile(between(read, 0, 0))
        result = solve(read)
        z.append(((result.range_m - true_m) / result.sigma_m)[result.valid])
    squares = np.concatenate(z) ** 2
    assert squares.size > 30
    assert squares.mean() < 1.2


# Images, depth maps and files


def captured(capture: Capture, spots: int) -> Capture:
    """The shared capture with so many spots on its wall, in clear air."""
    assert capture.spots is not None
    assert capture.truth is not None
    order = (np.arange(spots) % 4).tolist()
    side = int(np.ceil(np.sqrt(spots)))
    x, y = np.array(np.divmod(np.arange(spots), side)) - (side - 1) / 2
    directions = np.stack([0.15 * x / side, 0.15 * y / side, np.ones(spots)], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    truth = replace(capture.truth, spot_range_m=capture.truth.spot_range_m[:, order])
    return replace(
        capture, spots=replace(some_of(capture.spots, order), directions=directions), truth=truth
    )


@pytest.mark.parametrize("spots", NUMBERS)
def test_any_number_of_spots_makes_a_depth_map_and_a_result_file(capture, tmp_path, spots) -> None:
    many = captured(capture, spots)
    result = reconstruct(many, depth=["learned", "anchored", "nearest", "inverse-distance"])
    assert result.ranges.status == ("ok",) * spots
    np.testing.assert_allclose(result.ranges.range_m, many.truth.spot_range_m[0], atol=1e-3)
    for depth_m in result.depths.values():
        assert np.isfinite(depth_m).all()
        assert 4.0 < np.median(depth_m) < 5.0
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(result))
    copy = read_result(path).ranges
    assert copy.status == result.ranges.status
    np.testing.assert_array_equal(copy.range_m, result.ranges.range_m)


def test_the_anchored_map_gains_by_more_ranges() -> None:
    """A slanted wall of patches of any reflectance: brightness misleads, ranges do not."""
    rows, columns = np.mgrid[:32, :32]
    depth_m = 3 + 3 * columns / 31 + rows / 31
    patches = np.repeat(np.repeat(np.random.default_rng(0).uniform(0.1, 0.9, (8, 8)), 4, 0), 4, 1)
    errors = []
    for side in (1, 2, 4, 8):
        across = (np.arange(side) + 0.5) * 32 / side - 0.5
        anchors = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)
        known_m = 3 + 3 * anchors[:, 1] / 31 + anchors[:, 0] / 31
        result = anchored_depth(
            patches / depth_m**2, anchors, known_m, 0.01 * known_m, fitted_prior()
        )
        assert result is not None
        errors.append(np.abs(np.log(result.depth_m / depth_m)).mean())
    assert errors == sorted(errors, reverse=True), errors
    assert errors[-1] < 0.5 * errors[1]


@pytest.mark.parametrize("spots", [1, 9])
def test_brightness_and_consistency_are_per_spot(capture, spots) -> None:
    image, sigma = np.arange(256.0).reshape(16, 16), np.ones((16, 16))
    positions = np.array([[k % 3 + 4, 5] for k in range(spots - 1)] + [[-5, 40]], float)
    brightness = brightness_at(positions, image, sigma)
    expected = [16.0 * (k % 3 + 4) + 5 for k in range(spots - 1)] + [np.nan]
    np.testing.assert_allclose(brightness.electrons, expected)
    many = captured(capture, spots)
    ranges = ranged(many.spots, "cw")
    other = replace(ranges, range_m=ranges.range_m + 0.5 * (np.arange(spots) == spots - 1))
    other = replace(other, alternatives=(*other.alternatives[:-1], ((4.0, 0.1, 1.0),)))
    note = range_consistency({"cw": ranges, "other": other}, many.spots)["cw"]
    assert f"at spot {spots - 1} (" in note
    far = replace(other, range_m=ranges.range_m + 0.5)
    note = range_consistency({"cw": ranges, "other": far}, many.spots)["cw"]
    assert note.count("by other") == min(spots, 4)
    assert note.endswith("and 5 more") == (spots == 9)


# What is refused, and what is said of older files


def test_a_result_of_an_older_version_is_read(capture, tmp_path) -> None:
    path = tmp_path / "result.h5"
    result = reconstruct(capture)
    path.write_bytes(result_bytes(result))
    with changed(path) as file:
        file.attrs["version"] = "3.5"
    assert read_result(path).ranges.status == result.ranges.status


@pytest.mark.parametrize(
    ("name", "shape", "message"),
    [
        ("status", (0,), r"cw/status has shape \(0,\), expected \(spots,\), 1 to 64 of them"),
        ("status", (65,), r"cw/status has shape \(65,\), .* 1 to 64 of them"),
        ("status", (2, 2), r"cw/status has shape \(2, 2\), expected \(spots,\)"),
        ("sigma_m", (3,), r"cw/sigma_m has shape \(3,\), expected \(4,\)"),
        ("range_m", (5,), r"cw/range_m has shape \(5,\), expected \(4,\)"),
    ],
)
def test_a_result_of_wrong_numbers_of_spots_is_refused(
    capture, tmp_path: Path, name, shape, message
) -> None:
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(reconstruct(capture)))
    with changed(path) as file:
        group = file["rangings/cw"]
        units = group[name].attrs["units"]
        del group[name]
        group[name] = np.full(shape, b"ok") if name == "status" else np.ones(shape)
        group[name].attrs["units"] = units
    with pytest.raises(InputError, match=message):
        read_result(path)


def test_frames_of_another_number_of_spots_are_refused(capture) -> None:
    nine, four = captured(capture, 9), capture
    with pytest.raises(InputError, match=r"they have .*of 4 spots.*compiled for .*of 9 spots"):
        Reconstructor(nine.setup)(four.frame(0))


def test_a_method_that_gives_ranges_of_another_number_of_spots_is_named(capture) -> None:
    result = ranged(captured(capture, 3).spots, "cw")
    assert checked_ranges("mine", result, 3) is result
    with pytest.raises(InputError, match="'mine' returned Ranges, not ranges of 9 spot"):
        checked_ranges("mine", result, 9)


# Paths that are wrongly calibrated


def test_wrong_paths_are_told_among_nine_spots_and_not_of_two() -> None:
    instrument = of_spots("fog", 9)
    given = light(
        instrument, np.linspace(2.2, 3.6, 9), frames=12, extinction_per_m=0.2,
        backscatter_per_sr=0.045,
    )  # fmt: skip
    longer = replace(given, path_length_m=given.path_length_m + 0.4)
    spots, wrong = (
        instrument.tof.record(each, instrument.spot_optics, np.random.default_rng(3))
        for each in (given, longer)
    )
    taps = spots.taps.copy()
    taps[:, 6] = wrong.taps[:, 6]
    result = measure_path_offsets(replace(spots, taps=taps))
    assert np.flatnonzero(result.significant).tolist() == [6]
    assert result.offset_m[6] == pytest.approx(0.4, abs=4 * result.sigma_m[6])
    assert not measure_path_offsets(spots).significant.any()
    for few in ([0], [0, 1]):
        with pytest.raises(InputError, match=rf"the recording has {len(few)} spot\(s\) in all"):
            measure_path_offsets(some_of(spots, few))


def test_chance_makes_one_of_many_spots_stand_out_as_rarely_as_one_of_four() -> None:
    assert min_significance(4) == pytest.approx(3.5)
    assert [round(min_significance(n), 2) for n in (1, 16, 64)] == [3.11, 3.85, 4.18]
