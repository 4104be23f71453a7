"""`spisim budget` says what dominates, as text, JSON and picture."""

import json
from pathlib import Path

import matplotlib.image
import pytest

from commands import spisim
from spisim.budget import Target, range_sigma_m
from spisim.instrument import list_presets, load_instrument


def test_budget_prints_what_dominates() -> None:
    run = spisim("budget", "apd")
    assert run.exit_code == 0, run.stderr
    assert "Image: the noise of the daylight dominates" in run.stdout
    assert "class 1" in run.stdout
    assert "no certification" in run.stdout


def test_the_table_has_the_figures_of_the_report_in_its_units() -> None:
    """What --json gives in SI units: seconds in ms, metres of sigma in cm."""
    table = spisim("budget", "paper", "--visibility", "50").stdout
    ranges = json.loads(spisim("budget", "paper", "--visibility", "50", "--json").stdout)["range"]
    rows = {
        line.partition("  ")[0].strip(): line.partition("  ")[2].split()[0]
        for line in table.splitlines()
        if "  " in line.strip()
    }
    reported = float(rows["time of a frame, ms"])
    assert reported == pytest.approx(1e3 * ranges["frame_time_s"], rel=0.01)
    assert float(rows["standard deviation, cm"]) == pytest.approx(1e2 * ranges["sigma_m"], rel=0.05)
    assert float(rows["unambiguous up to, m"]) == pytest.approx(ranges["unambiguous_m"], rel=0.01)


def test_budget_as_json() -> None:
    run = spisim("budget", "fga015", "--visibility", "50", "--range", 4, "--json")
    assert run.exit_code == 0, run.stderr
    report = json.loads(run.stdout)
    sigma = range_sigma_m(load_instrument("fga015"), Target(**report["target"])).max()
    assert report["target"]["extinction_per_m"] == pytest.approx(3.912 / 50 * 1.1416, rel=1e-3)
    assert report["range"]["sigma_m"] == pytest.approx(sigma)
    assert report["image"]["dominating"]["source"] == "amplifier"
    assert [each[:28] for each in report["warnings"]] == ["there is hardly an image at "]
    assert report["image"]["coefficient_snr"] < 1 < report["image"]["frames_to_average"]
    assert report["fog"]["plain_bias_m"] < 0 < report["fog"]["echo_share"]


def test_without_options_the_target_is_a_grey_wall_in_full_daylight() -> None:
    stated = ("--range", 5, "--reflectance", 0.5, "--illuminance", 100)
    plain, same = (spisim("budget", "paper", *words, "--json").stdout for words in ((), stated))
    assert json.loads(plain)["target"] == json.loads(same)["target"]


def test_frames_are_averaged_for_a_wanted_correlation() -> None:
    for wanted, words in ((0.7, "frames to average for 0.7"), (0.95, "none are enough")):
        run = spisim("budget", "fga015", "--correlation", wanted)
        assert words in run.stdout


def test_budget_tells_what_fog_does_and_only_then() -> None:
    clear, foggy = (spisim("budget", "paper", *fog).stdout for fog in ([], ["--visibility", "50"]))
    assert "fog" not in clear
    for part in ("bias by the echo of fog, cm", "fog and wall fitted", "% is the fog's"):
        assert part in foggy


@pytest.mark.slow
@pytest.mark.parametrize("name", list_presets())
def test_budget_draws_a_picture(name: str, tmp_path: Path) -> None:
    picture = tmp_path / "budget.png"
    run = spisim("budget", name, "-o", picture)
    assert run.exit_code == 0, run.stderr
    assert matplotlib.image.imread(picture).shape[1] > 1000


def test_budget_warns() -> None:
    run = spisim("budget", "paper", "--range", "12")
    assert run.exit_code == 0
    assert "warning: ranges at 12 m are ambiguous" in run.stderr


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["papre"], ["no instrument 'papre'", "did you mean 'paper'"]),
        (["missing.yaml"], ["missing.yaml", "no such file"]),
        (["--range", "-1"], ["--range", "-1 is not a number from 0.01 to 10000"]),
        (["--reflectance", "1.5"], ["--reflectance"]),
        (["--illuminance", "-5"], ["--illuminance"]),
        (["--range", "nan"], ["--range", "nan is not a number"]),
        (["--visibility", "far"], ["--visibility", "far is not a number"]),
        (["--visibility", "0"], ["visibility_m", "greater than 0"]),
        (["-o", "."], ["folder"]),
    ],
)
def test_mistakes_of_the_command_line(arguments: list[str], parts: list[str]) -> None:
    run = spisim("budget", *arguments)
    assert run.exit_code == 2
    assert run.stdout == ""
    for part in parts:
        assert part in run.stderr
