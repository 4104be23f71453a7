"""Instrument files written from data sheets."""

import json
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from reconstruction.base.errors import InputError
from spisim.base.config import parse_model
from spisim.budget import Target, budget_warnings, plots
from spisim.instrument import Instrument, load_instrument
from spisim_app.cli import app
from spisim_app.cli.instrument import new
from spisim_app.cli.instrument.data_sheet import QUESTIONS, completed
from spisim_app.cli.instrument.full_scale import new_instrument_text

ALL = [
    {},
    {"makes": "image"},
    {"makes": "ranges", "frame_time_s": 0.02},
    {"modulation": "pulsed", "range_part": "g14858-0020aa"},
    {"modulation": "dtof", "spots": 1},
    {"makes": "ranges", "spots": 64, "frequency_hz": 30e6},
    {"image_part": "ingaas-spad", "wavelength_nm": 1460, "pixels": 32},
]


def invoke(*words: str | Path) -> Any:
    return CliRunner().invoke(app, ["instrument", "new", *map(str, words)])


@pytest.mark.parametrize("answers", ALL)
def test_answers_become_an_instrument(answers: dict[str, Any]) -> None:
    given = completed(answers)
    instrument = parse_model(new_instrument_text(given), Instrument, "mine.yaml")
    assert instrument.images == (given["makes"] != "ranges")
    assert instrument.ranges == (given["makes"] != "image")
    if instrument.images:
        projector = instrument.imaging.projector
        assert projector.shape == (given["pixels"],) * 2
        assert projector.power_w == given["array_power_w"]
    if instrument.ranges:
        ranging = instrument.ranging
        assert ranging.spots == given["spots"]
        assert ranging.tof.method == given["modulation"]
        assert ranging.lasers.power_w == given["laser_power_w"]
        assert ranging.tof.frame_time_s == pytest.approx(instrument.frame_time_s, rel=1e-2)
    if not instrument.images:
        assert instrument.frame_time_s == pytest.approx(
            given["frame_time_s"] * (1 if not instrument.ranging.shared else given["spots"])
        )


def test_the_defaults_are_those_of_the_paper() -> None:
    paper = load_instrument("paper")
    made = parse_model(new_instrument_text(completed({})), Instrument, "mine.yaml")
    assert made.pattern_plan.exposures == paper.pattern_plan.exposures
    assert made.imaging.projector.shape == paper.imaging.projector.shape
    assert made.imaging.projector.power_w == paper.imaging.projector.power_w
    assert made.ranging.spots == paper.ranging.spots


def test_converters_hold_a_white_wall_near_by() -> None:
    instrument = parse_model(new_instrument_text(completed({})), Instrument, "mine.yaml")
    bright = budget_warnings(instrument, Target(1.0, 1.0, 100.0))
    assert not [warning for warning in bright if "saturate" in warning]
    brighter = budget_warnings(instrument, Target(0.3, 1.0, 100.0))
    assert [warning for warning in brighter if warning.startswith("detector.adc")]


@pytest.mark.parametrize(
    ("answers", "message"),
    [
        ({"makes": "imag"}, "makes 'imag': did you mean 'image'"),
        ({"image_part": "fga01"}, "image_part 'fga01': did you mean 'fga015'"),
        ({"frequency_hz": "20"}, "frequency_hz 20: .* if it is in MHz, write 20e6"),
        (
            {"makes": "image", "spots": 3},
            "spots 3: does not apply to .* that makes an image",
        ),
        ({"pulse_s": 1e-8}, "pulse_s 1e-08: does not apply to .* with cw"),
        ({"patterns": "many"}, "patterns many: a whole number from 1"),
        ({"array_power_w": "nan"}, "array_power_w nan: a number from"),
        ({"wavelength_nm": 905}, "image_part fga015: .* 1400 to 1600 nm"),
        ({"range_part": "ingaas-spad"}, "tof: cw integrates charge.*choose method dtof"),
    ],
)
def test_wrong_answers_are_named(answers: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        new_instrument_text(completed(answers))


def test_file_and_budget_are_written_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "mine.yaml"
    done = invoke("-o", file, "--makes", "image", "--field-deg", 30, "--json")
    assert done.exit_code == 0, done.output
    report = json.loads(done.stdout)
    assert report["spots"] is None
    assert report["image"]["emitted_w"] > 0
    assert load_instrument(file).imaging.projector.fov_deg == 30
    assert file.read_text(encoding="utf-8").count("#") > 10
    assert Path(report["written"]) == file.with_suffix(".png")
    assert "exists; --overwrite" in invoke("-o", file, "--defaults").output
    monkeypatch.setattr(plots, "budget_figure", lambda *_: Figure())  # it takes seconds to draw
    assert invoke("-o", file, "--defaults", "--overwrite").exit_code == 0


def test_nothing_is_written_of_wrong_answers(tmp_path: Path) -> None:
    done = invoke("-o", tmp_path / "mine.yaml", "--pixels", 60, "--defaults")
    assert done.exit_code == 2
    assert "powers of two" in done.output
    assert not list(tmp_path.iterdir())


def test_questions_are_asked_until_they_are_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replies = iter(["ranges", "", "-3", "5", *[""] * len(QUESTIONS)])
    asked: list[str] = []

    def prompt(text: str, *, default: Any, **_: Any) -> str:
        asked.append(text.rpartition("(")[2].rstrip(")"))
        return next(replies) or str(default)

    monkeypatch.setattr(new.typer, "prompt", prompt)
    given = dict.fromkeys(QUESTIONS) | {"spots": "4"}
    answers = new._asked(given)
    assert asked[:4] == ["makes", "wavelength_nm", "filter_width_nm", "filter_width_nm"]
    assert not {"pixels", "spots", "pulse_s"} & set(asked)
    assert answers["filter_width_nm"] == 5
    assert completed(answers)["frequency_hz"] == 15e6
