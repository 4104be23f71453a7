"""Weather from the command line: `spisim weather`, and the options of the simulating commands."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.main import get_command
from typer.testing import CliRunner

from reconstruction.base.errors import InputError
from spisim.atmosphere import combine, fog, rain, snow
from spisim.budget.wavelengths import WAVELENGTHS_NM, class_1_limits, wavelength_figures
from spisim_app.cli import app
from spisim_app.cli.inputs import scene_with
from spisim_app.cli.weather_options import Weather, WeatherOfDrops

WEATHER = ["weather", "--fog", "heavy-radiation", "--visibility", "50"]


def spisim(*arguments: str) -> Any:
    return CliRunner().invoke(app, list(arguments), env={"COLUMNS": "140"})


def report(*arguments: str) -> dict[str, Any]:
    run = spisim(*arguments, "--json")
    assert run.exit_code == 0, run.stderr
    parsed: dict[str, Any] = json.loads(run.stdout)
    return parsed


def test_weather_is_what_the_media_are() -> None:
    result = report(*WEATHER, "--rain", "10", "--snow", "1", "--smoke", "30")
    parts = [fog(50, "heavy-radiation"), fog(30, "fog-machine"), rain(10), snow(1)]
    for key, value in combine(parts).summary().items():
        assert result[key] == (pytest.approx(value) if isinstance(value, float) else value), key
    assert [part["kind"] for part in result["media"]] == [part.kind for part in parts]
    assert result["empirical"]["al-naboulsi-advection"] == pytest.approx(0.0803, abs=1e-4)
    assert "kruse" not in result["empirical"]  # which is for haze
    assert "ijaz-smoke" not in result["empirical"]  # which is for smoke
    assert set(result["empirical_smoke"]) == {"ijaz-smoke"}
    assert result["wavelength_nm"] == 1550
    assert result["warnings"] == []


def test_rain_tells_what_a_narrow_link_loses() -> None:
    """Links in the literature lose 5.0 to 6.8 dB/km at 10 mm/h; this camera sees the diffracted."""
    result = report("weather", "--rain", "10")
    assert result["extinction_db_per_km"] < 4
    assert 5.0 <= result["rain_with_diffraction"]["extinction_db_per_km"] <= 7.0
    assert "a narrow link loses it" in " ".join(spisim("weather", "--rain", "10").stdout.split())
    assert report(*WEATHER)["rain_with_diffraction"] is None


def test_comparison_of_wavelengths() -> None:
    result = report(*WEATHER, "--compare")["compare"]
    assert [row["wavelength_nm"] for row in result] == [850, 905, 940, 1460, 1550]
    for row in result:
        expected = fog(50, "heavy-radiation", wavelength_nm=row["wavelength_nm"])
        assert row["extinction_per_m"] == pytest.approx(expected.extinction_per_m)
        assert row["visibility_m"] == 50
        assert row["over_1550_nm"] < 1.01  # fog is no thinner at longer wavelengths
    smoke = report("weather", "--smoke", "20", "--smoke-kind", "soot", "--compare")["compare"]
    assert smoke[0]["over_1550_nm"] > 1.8  # but smoke is


def test_figures_of_wavelengths() -> None:
    """Class 1 by hand, and the absorption band of water between the lidar wavelengths."""
    assert class_1_limits(850) == pytest.approx((3.9e-4 * 10**0.3, 7.7e-8 * 10**0.3))
    assert class_1_limits(1460) == (1e-2, 8e-4)
    assert class_1_limits(1550) == (1e-2, 8e-3)
    figures = {nm: wavelength_figures(nm) for nm in WAVELENGTHS_NM}
    assert figures[1460]["water_k"] > 2 * figures[1550]["water_k"] > 100 * figures[905]["water_k"]
    assert figures[1550]["ice_k"] > 3 * figures[1550]["water_k"]
    # 2.967 W/m² within 1544 to 1556 nm
    assert 12 * figures[1550]["sun_w_per_m2_nm_100klx"] == pytest.approx(2.967, rel=1e-3)
    with pytest.raises(InputError, match="allowed: 850, 905, 940, 1460, 1550"):
        wavelength_figures(1064)


def test_comparison_of_typical_weather() -> None:
    """Without weather of one's own: fog is no thinner at longer wavelengths, haze and smoke are."""
    rows = report("weather", "--compare")["compare"]
    assert [row["wavelength_nm"] for row in rows] == list(WAVELENGTHS_NM)
    at_905, at_1550 = (row["over_1550_nm"] for row in (rows[1], rows[4]))
    expected = fog(50, "moderate-radiation", wavelength_nm=905).extinction_per_m
    expected /= fog(50, "moderate-radiation").extinction_per_m
    assert at_905["moderate radiation fog, 50 m"] == pytest.approx(expected)
    assert set(at_1550.values()) == {1.0}
    for name, ratio in at_905.items():
        thinner = name.startswith(("haze", "fog machine", "soot", "biomass"))
        assert (ratio > 1.2) if thinner else (0.9 < ratio < 1), name
    figures = wavelength_figures(905)
    assert {key: rows[1][key] for key in figures} == figures


def test_tables_for_people_hold_every_medium() -> None:
    run = spisim(*WEATHER, "--rain", "10", "--compare")
    assert run.exit_code == 0
    for word in ("heavy-radiation", "rain, 10 mm/h", "together", "p(180°)", "1460 nm", "class 1"):
        assert word in run.stdout


@pytest.mark.parametrize(
    "options",
    [
        ["--compare"],
        [*WEATHER, "--compare"],
        [*WEATHER, "--rain", "10", "--snow", "2", "--smoke", "20"],
    ],
)
def test_tables_lose_nothing_on_a_narrow_terminal(options: list[str]) -> None:
    args = options if options[0] == "weather" else ["weather", *options]
    run = CliRunner().invoke(app, args, env={"COLUMNS": "80"})
    assert run.exit_code == 0
    assert "…" not in run.stdout
    if "--compare" in options:
        assert max(map(len, run.stdout.split("\n\n")[-1].splitlines())) <= 80
    else:
        rows = [line for line in run.stdout.splitlines() if line.startswith("at 1550 nm: ")]
        assert len(rows) > 5
        assert run.stdout.count("  together: ") >= len(rows)


def test_doubtful_weather_is_told() -> None:
    run = spisim("weather", "--fog", "heavy-advection", "--visibility", "10")
    assert run.exit_code == 0
    assert "5.05 g/m³" in run.stderr
    assert report("weather", "--water", "0.1")["water_g_per_m3"] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ([], ["no weather", "--visibility", "--compare"]),
        (["--fog", "heavy-advection"], ["--fog needs --visibility or --water"]),
        (["--fog", "heavy-fog", "--visibility", "50"], ["'heavy-fog'", "heavy-advection"]),
        (["--visibility", "0"], ["--visibility", "0 is not a number of at least 0.001"]),
        (["--visibility", "inf"], ["visibility_m", "finite"]),
        (["--visibility", "10", "--water", "5"], ["10", "5", "contradict"]),
        (["--visibility", "10", "--definition", "moor"], ["did you mean 'mor'"]),
        (["--rain", "301"], ["of rain", "300", "301"]),
        (["--rain", "10", "--wavelength", "1310"], ["550, 850, 905", "1310"]),
        (["--snow", "1", "--snow-kind", "wett"], ["did you mean 'wet'"]),
        (["--smoke", "10", "--smoke-kind", "soott"], ["did you mean 'soot'"]),
        (["--visibility", "50", "--wavelength", "200"], ["wavelength", "700"]),
    ],
)
def test_mistake_in_the_weather(options: list[str], parts: list[str]) -> None:
    run = spisim("weather", *options)
    assert run.exit_code == 2
    assert run.stdout == ""
    assert "Traceback" not in run.stderr
    for part in parts:
        assert part in run.stderr


# The options of the simulating commands

SCENE = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [5, 0, 1], material: concrete}
"""


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    return tmp_path / "scene.yaml"


def test_options_change_the_weather_and_the_scene_s_text(scene_file: Path) -> None:
    scene_file.write_text(SCENE + "fog: {visibility_m: 100, definition: mor, phase: hg}\n")
    scene, _ = scene_with(
        str(scene_file), 1550, Weather(visibility=50, fog="heavy-radiation", rain=5)
    )
    expected = combine([fog(50, "heavy-radiation", "mor", phase="hg"), rain(5)])
    assert scene.atmosphere.summary() == expected.summary()
    assert yaml.safe_load(scene.text)["rain"] == {"rate_mm_per_h": 5}
    thicker, _ = scene_with(str(scene_file), 1550, Weather(fog="haze-m"))
    assert thicker.atmosphere.visibility_m == 100
    assert thicker.atmosphere.kind == "haze-m"
    clear, _ = scene_with(str(scene_file), 1550, Weather(clear=True))
    assert clear.atmosphere.extinction_per_m == 0
    assert "fog" not in yaml.safe_load(clear.text)


def test_options_replace_a_medium_by_coefficients(scene_file: Path) -> None:
    scene_file.write_text(SCENE + "fog: {extinction_per_m: 0.1, phase: {g: 0.5}}\n")
    scene, _ = scene_with(str(scene_file), 1550, Weather(visibility=50))
    assert scene.atmosphere.kind == "moderate-radiation"
    with pytest.raises(InputError, match="--fog needs --visibility"):
        scene_with(str(scene_file), 1550, Weather(fog="haze-m"))


@pytest.mark.parametrize("medium", ["visibility", "rain", "snow", "smoke"])
def test_clear_and_weather_exclude_each_other(medium: str) -> None:
    with pytest.raises(InputError, match=f"--clear and --{medium} exclude each other"):
        Weather(clear=True, **{medium: 5.0})


def test_single_drops_go_with_what_falls() -> None:
    with pytest.raises(InputError, match="--drops goes with --rain or --snow"):
        WeatherOfDrops(smoke=20.0, drops=True)
    sections = WeatherOfDrops(snow=2.0, drops=True).sections({})
    assert sections == {"snow": {"rate_mm_per_h": 2.0, "model": "drops"}}


@pytest.mark.parametrize("command", ["simulate", "transport", "picture", "fly", "serve"])
def test_all_commands_that_send_light_have_all_weather(command: str) -> None:
    reported = {name for each in get_command(app).commands[command].params for name in each.opts}
    assert {"--visibility", "--fog", "--rain", "--snow", "--smoke", "--clear"} <= reported
    assert ("--drops" in reported) == (command in ("simulate", "fly", "serve"))


# Another wavelength


def test_an_instrument_moved_to_905_nm_by_its_budget() -> None:
    here, there = report("budget", "paper"), report("budget", "paper", "--wavelength", "905")
    ratio = there["image"]["daylight_w"] / here["image"]["daylight_w"]
    figures = [wavelength_figures(nm)["sun_w_per_m2_nm_100klx"] for nm in (905, 1550)]
    assert ratio == pytest.approx(figures[0] / figures[1])
    assert there["image"]["signal_w"] == pytest.approx(here["image"]["signal_w"])
    assert there["eye_safety"]["lasers"]["laser_class"] == "3R"
    assert here["eye_safety"]["lasers"]["laser_class"] == "1"
    assert there["eye_safety"]["array"]["retinal_margin"] > 1
    assert here["eye_safety"]["array"]["retinal_margin"] == 0
    table = spisim("budget", "paper", "--wavelength", "905").stdout
    assert "on the retina" in table
    assert "on the retina" not in spisim("budget", "paper").stdout


def test_a_scene_is_loaded_at_the_instrument_s_wavelength(scene_file: Path) -> None:
    scene_file.write_text(SCENE)
    result, _ = scene_with(str(scene_file), 905, Weather(visibility=50, fog="haze-l"))
    assert result.wavelength_nm == 905
    expected = fog(50, "haze-l", wavelength_nm=905)
    assert result.atmosphere.extinction_per_m == expected.extinction_per_m


@pytest.mark.parametrize("command", ["simulate", "transport", "picture", "budget"])
def test_wavelengths_that_nothing_is_known_at(command: str, tmp_path: Path) -> None:
    name = "out.h5" if command == "simulate" else "out.exr"
    where = ["paper"] if command == "budget" else ["warehouse", "-o", str(tmp_path / name)]
    run = spisim(command, *where, "--wavelength", "532")
    assert run.exit_code == 2
    assert "instrument at 532 nm: wavelength_nm: should be from 800 to 1600" in (
        " ".join(run.stderr.split())
    )
    assert not list(tmp_path.iterdir())
