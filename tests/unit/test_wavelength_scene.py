"""Scenes at other wavelengths: their weather, and instruments that do not fit them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import worlds
from reconstruction.base.errors import InputError
from spisim.atmosphere import fog, precipitation, rain, snow
from spisim.budget.wavelengths import WAVELENGTHS_NM
from spisim.instrument import load_instrument
from spisim.scene import Scene, load_scene
from spisim.simulation.light import solve
from spisim.transport import camera_view, ground_truth

SCENE = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [5, 0, 1], material: concrete}
"""
Load = Callable[..., Scene]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def from_text(sections: str, **options: float) -> Scene:
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE + sections)
        return load_scene(path, **options)

    return from_text


def test_1550_nm_unless_told_otherwise(load: Load) -> None:
    assert load("fog: {visibility_m: 50}").wavelength_nm == 1550
    assert load("", wavelength_nm=905).wavelength_nm == 905


@pytest.mark.parametrize("wavelength_nm", WAVELENGTHS_NM)
def test_weather_is_that_of_the_wavelength(load: Load, wavelength_nm: int) -> None:
    expected = {
        "fog: {visibility_m: 500, kind: haze-l}": fog(500, "haze-l", wavelength_nm=wavelength_nm),
        "smoke: {visibility_m: 20}": fog(20, "fog-machine", wavelength_nm=wavelength_nm),
        "rain: {rate_mm_per_h: 10}": rain(10, wavelength_nm=wavelength_nm),
        "snow: {rate_mm_per_h: 2}": snow(2, wavelength_nm=wavelength_nm),
    }
    for section, medium in expected.items():
        result = load(section, wavelength_nm=wavelength_nm).atmosphere
        assert result.summary() == medium.summary()


def test_weather_of_volumes_too(load: Load) -> None:
    text = (
        "volumes: [{name: bank, size_m: [1, 1, 1], translate_m: [3, 0, 1], "
        "kind: haze-l, visibility_m: 500}]"
    )
    (volume,) = load(text, wavelength_nm=905).volumes
    expected = fog(500, "haze-l", wavelength_nm=905).extinction_per_m
    assert volume.medium.extinction_per_m == expected


def test_rain_and_snow_of_single_drops(load: Load) -> None:
    text = "rain: {rate_mm_per_h: 5, model: drops}\nsnow: {rate_mm_per_h: 1, model: drops}"
    scene = load(text, wavelength_nm=905)
    assert scene.atmosphere.extinction_per_m == 0
    reported = {row["kind"]: row for row in scene.media_summary()}
    assert set(reported) == {"rain, 5 mm/h, single drops", "snow, 1 mm/h, single drops"}
    assert {row["where"] for row in reported.values()} == {"air, single drops"}
    drops = precipitation.rain(5, wavelength_nm=905).summary()
    assert reported["rain, 5 mm/h, single drops"] == {"where": "air, single drops"} | drops


def test_what_a_scene_says_of_snow_holds_at_every_wavelength(load: Load) -> None:
    for model in ("medium", "drops"):
        text = f"snow: {{rate_mm_per_h: 1, model: {model}, albedo: 0.6}}"
        (reported,) = load(text, wavelength_nm=905).media_summary()
        assert reported["albedo"] == pytest.approx(0.6)


def test_what_is_assumed_of_flakes_can_be_given(load: Load) -> None:
    (reported,) = load(
        "snow: {rate_mm_per_h: 2, model: drops, flake_density_kg_m3: 50, fall_speed_m_s: 0.8}"
    ).precipitation
    expected = precipitation.snow(2, flake_density_kg_m3=50, fall_speed_m_s=0.8)
    assert reported.summary() == expected.summary()
    assert reported.extinction_per_m > 1.2 * precipitation.snow(2).extinction_per_m
    assert reported.fall_speed_m_s(np.ones(1)) == 0.8
    (rain,) = load("rain: {rate_mm_per_h: 2, model: drops, kind: joss-drizzle}").precipitation
    assert rain.summary() == precipitation.rain(2, "joss-drizzle").summary()


def test_coefficients_hold_at_every_wavelength(load: Load) -> None:
    text = "fog: {extinction_per_m: 0.1, g: 0.8}"
    assert load(text, wavelength_nm=905).atmosphere.extinction_per_m == 0.1


def test_wavelengths_without_tables_are_refused(load: Load) -> None:
    with pytest.raises(InputError, match=r"scene\.yaml: fog: wavelength_nm.*400 and 1700"):
        load("fog: {visibility_m: 50}", wavelength_nm=2000)
    for model in ("medium", "drops"):
        with pytest.raises(InputError, match=r"scene\.yaml: rain: rain is tabulated at.*1310"):
            load(f"rain: {{rate_mm_per_h: 5, model: {model}}}", wavelength_nm=1310)


@pytest.mark.parametrize("use", [solve, ground_truth, camera_view])
def test_scene_and_instrument_of_two_wavelengths(use: Callable[..., object]) -> None:
    position = replace(worlds.scene(worlds.plane(4.0)), wavelength_nm=905.0)
    with pytest.raises(InputError) as caught:
        use(position, load_instrument("paper"))
    message = str(caught.value)
    for part in ("wavelength_nm 1550", "905", "wavelength_nm=1550", "at_wavelength(905)"):
        assert part in message
