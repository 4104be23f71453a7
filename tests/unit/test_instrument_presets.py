"""Presets as their files are, on the command line."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from reconstruction.base.errors import InputError
from spisim.instrument import list_presets, load_instrument
from spisim.instrument.model import PRESETS
from spisim_app.cli import app


def invoke(*words: str | Path) -> Any:
    return CliRunner().invoke(app, ["instrument", *map(str, words)])


def test_all_presets_are_listed() -> None:
    table, report = invoke("list").stdout, json.loads(invoke("list", "--json").stdout)
    assert sorted(report["instruments"]) == list_presets()
    assert all(name in table for name in list_presets())
    assert report["instruments"]["tmf8820"].endswith("3 x 3 zones: ams OSRAM TMF8820")


@pytest.mark.parametrize("name", list_presets())
def test_a_file_is_shown_and_copied_with_its_comments(tmp_path: Path, name: str) -> None:
    text = (PRESETS / f"{name}.yaml").read_text(encoding="utf-8")
    assert "# " in text
    assert invoke("show", name).stdout == text
    copied = invoke("copy", name, "-o", tmp_path / "mine.yaml")
    assert copied.exit_code == 0, copied.output
    assert (tmp_path / "mine.yaml").read_text(encoding="utf-8") == text
    assert load_instrument(tmp_path / "mine.yaml").text == load_instrument(name).text


def test_a_file_of_the_user_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "fog.yaml").write_text("mine")
    refused = invoke("copy", "fog", "-o", tmp_path / "fog.yaml")
    assert isinstance(refused.exception, InputError) or refused.exit_code == 2
    assert (tmp_path / "fog.yaml").read_text() == "mine"


def test_an_unknown_name_has_the_nearest_named() -> None:
    refused = invoke("show", "vl53l5")
    assert "vl53l5cx" in str(refused.exception) + refused.output
