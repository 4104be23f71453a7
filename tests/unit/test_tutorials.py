"""Notebooks of the tutorials: stored with what they show, and small."""

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "tutorials"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
#: Of a notebook with its pictures.
MAX_BYTES = 300_000


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_notebook_shows_is_stored(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    assert not [output for output in outputs if output["output_type"] == "error"]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert path.stat().st_size < MAX_BYTES


def test_every_notebook_is_listed():
    listed = (FOLDER / "index.md").read_text(encoding="utf-8")
    assert all(f"({path.stem}.md)" in listed for path in NOTEBOOKS)
    assert len(NOTEBOOKS) == 7
