"""Wrongly calibrated paths, told by the echo of fog in many frames; light as in `fogs`."""

import json
from dataclasses import replace

import numpy as np
import pytest

from captures import full_capture
from fogs import PATHS, light
from instruments import WINDOWS, changed
from reconstruction import write_capture
from reconstruction.base.errors import InputError
from reconstruction.capture import Spots
from reconstruction.capture.schema import between
from reconstruction.cli import main
from reconstruction.ranging.fog.echo_model import EchoModel
from reconstruction.ranging.fog.of_charge import echo_combinations
from reconstruction.ranging.fog.offsets import measure_path_offsets, path_check, path_offsets
from spisim.instrument import load_instrument

RANGES = np.array([2.2, 2.8, 3.2, 3.6])
DENSE = {"extinction_per_m": 0.2, "backscatter_per_sr": 0.045}


def record(offset_m: float = 0.0, frames: int = 30, density=1.0, name="fog", **fog) -> Spots:
    """Readings in fog that is denser by a factor (4, bins); spot 1 takes its path for longer."""
    instrument = changed("hybrid", **WINDOWS) if name == "windows" else load_instrument(name)
    tof, optics = instrument.tof, instrument.spot_optics
    given = light(instrument, RANGES, frames=frames, **fog)
    given = replace(given, echo_per_s=given.echo_per_s * density)
    longer = replace(given, path_length_m=given.path_length_m + offset_m)
    right, wrong = (tof.record(each, optics, np.random.default_rng(3)) for each in (given, longer))
    taps = right.taps.copy()
    taps[:, 1] = wrong.taps[:, 1]
    return replace(right, taps=taps)


def test_readings_and_slopes_of_target_and_fog() -> None:
    """Readings against light in closed form, slopes against differences of readings."""
    instrument = load_instrument("fog")
    fog = np.log([0.004, 0.1])
    given = light(instrument, 4.0, extinction_per_m=0.1, backscatter_per_sr=0.04, steady_per_s=0)
    spots = instrument.tof.record(given, instrument.spot_optics, None)
    combine, response = echo_combinations(between(spots, 0, 0), 9.0)
    model = EchoModel(spots, response, 9.0)
    echo = model(2, 4.0, 0.3, fog)
    read = combine @ spots.electrons(spots.taps[0, 2])
    np.testing.assert_allclose(echo.readings, read, atol=2e-3 * np.abs(read).max())

    def slope(step: float, spot_m: float = 0, reflectance: float = 0, fog_log=(0, 0)) -> np.ndarray:
        one, other = (
            model(2, 4 + s * spot_m, 0.3 + s * reflectance, fog + s * np.array(fog_log)).readings
            for s in (-step, step)
        )
        return (other - one) / (2 * step)

    result = np.concatenate([echo.of_fog, echo.of_target[:, :2]], axis=1)
    expected = [slope(1e-3, fog_log=(1, 0)), slope(1e-3, fog_log=(0, 1)), slope(0.01, 1)]
    expected = np.stack([*expected, slope(0.1, reflectance=1)], axis=1)
    size = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(result / size, expected / size, atol=5e-3)
    shifted = EchoModel(spots, lambda path_m: response(path_m + 0.01), 9.0)(2, 4.0, 0.3, fog)
    turned = (shifted.readings - echo.readings) / 0.01
    np.testing.assert_allclose(echo.of_target[:, 2], turned, atol=0.05 * np.abs(turned).max())


def test_a_target_beyond_the_unambiguous_range_is_no_offset() -> None:
    """Its range is known, but the model of echoes ends before it."""
    instrument = load_instrument("fog")
    fog = {"extinction_per_m": 0.05, "backscatter_per_sr": 0.04}
    given = light(instrument, [4.0, 5.0, 6.0, 10.15], frames=20, **fog)
    spots = instrument.tof.record(given, instrument.spot_optics, np.random.default_rng(3))
    result = measure_path_offsets(spots)
    assert not result.significant.any()
    assert np.abs(np.nan_to_num(result.offset_m)).max() < 0.5


@pytest.mark.parametrize("offset_m", [0.2, -0.15])
def test_an_offset_of_one_spot_is_told(offset_m: float) -> None:
    result = measure_path_offsets(record(offset_m, frames=80, **DENSE))
    assert result.frames == 80
    assert result.significant.tolist() == [False, True, False, False]
    assert (np.abs(result.offset_m - [0, offset_m, 0, 0]) < 3.5 * result.sigma_m).all()
    assert result.sigma_m.max() < 0.04


def test_windows_of_pulses_tell_an_offset_too() -> None:
    result = measure_path_offsets(record(0.2, name="windows", **DENSE))
    assert result.significant.tolist() == [False, True, False, False]


def test_offsets_scatter_as_their_sigma_says() -> None:
    spots = record(frames=40, **DENSE)
    find = path_check(between(spots, 0, 0))
    reported = [find(between(spots, k, k + 1)) for k in range(40)]
    each = [path_offsets(reported[k : k + 4], 4) for k in range(0, 40, 4)]
    z = np.array([result.offset_m / result.sigma_m for result in each])
    assert np.abs(z).max() < 3.5
    # Of each four, three differ; where they agree by chance, sigma grows all the same.
    assert 0.4 < (z**2).mean() < 1 + 4 * np.sqrt(2 / (3 * len(each)))


def test_patches_that_stand_still_are_not_told_as_an_offset() -> None:
    """Fog that is half as dense again over some metres before one spot, the same in all frames."""
    density = np.ones((4, PATHS.size))
    density[1, PATHS < 3.0] = 1.5
    density[3, PATHS < 2.0] = 0.7
    result = measure_path_offsets(record(density=density, **DENSE))
    assert not result.significant.any()


def test_clear_air_tells_nothing() -> None:
    assert measure_path_offsets(record(frames=5)).sigma_m.min() > 0.5
    assert np.isinf(
        measure_path_offsets(record(frames=1, **DENSE, steady_per_s=1e16)).sigma_m
    ).all()


def test_histograms_are_refused() -> None:
    photons = load_instrument("fog-spad")
    spots = photons.tof.record(light(photons, RANGES), photons.spot_optics, None)
    with pytest.raises(InputError, match="from taps and windows, not from histograms"):
        measure_path_offsets(spots)


# On the command line


def write(path, spots: Spots) -> str:
    capture = replace(full_capture(), truth=None, pattern_taps=None, poses=None)
    frames = len(spots.readings)
    buckets = replace(
        capture.buckets,
        counts=np.repeat(capture.buckets.counts[:1], frames, axis=0),
        saturated=np.zeros((frames, 20), dtype=bool),
    )
    write_capture(
        replace(capture, buckets=buckets, spots=spots, truth=None, pattern_taps=None, poses=None),
        path,
    )
    return str(path)


def test_captures_are_checked_together(tmp_path, capsys) -> None:
    spots = record(0.4, frames=16, **DENSE)
    halves = [write(tmp_path / f"{k}.h5", between(spots, k, k + 8)) for k in (0, 8)]
    assert main(["check", *halves, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["frames"] == 16
    assert [spot["told"] for spot in report["spots"]] == [False, True, False, False]
    assert report["spots"][1]["path_offset_m"] == pytest.approx(0.4, abs=0.2)


def test_what_a_check_says(tmp_path, capsys) -> None:
    assert main(["check", write(tmp_path / "fog.h5", record(0.6, frames=8, **DENSE))]) == 0
    assert "standard deviation" in (messages := capsys.readouterr().out)
    assert messages.count("wrongly calibrated, its ranges are") == 1
    assert main(["check", write(tmp_path / "clear.h5", record(0.6, frames=2))]) == 0
    assert "too little fog" in capsys.readouterr().out


def test_captures_of_different_rigs_are_not_checked_together(tmp_path, capsys) -> None:
    spots = record(frames=2, **DENSE)
    one = write(tmp_path / "one.h5", spots)
    other = write(tmp_path / "other.h5", replace(spots, beam_waist_m=0.001))
    assert main(["check", one, other]) == 2
    assert "other.h5: its spots are measured differently from those of" in capsys.readouterr().err
