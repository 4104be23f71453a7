"""What the scenes say of themselves, and the page about them."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import scene_gallery
from reconstruction import InputError
from spisim.scene import catalogue, list_scenes
from spisim.scene.families import FAMILIES
from spisim.scene.load import weather
from spisim_app.cli import app

DOCS = Path(__file__).parents[2] / "docs"


def test_catalogue_knows_every_shipped_scene() -> None:
    entries = {entry.name: entry for entry in catalogue()}
    assert list(entries) == list_scenes()
    assert all(entry.description for entry in entries.values())
    assert entries["warehouse"].weather == ("fog 200 m",)
    assert entries["warehouse"].family is None


def test_weather_in_words() -> None:
    fields = {
        "rain": {"rate_mm_per_h": 5, "model": "drops"},
        "fog": {"extinction_per_m": 0.25, "albedo": 1},
        "snow": None,
        "volumes": [{"name": "plume", "visibility_m": 3}],
    }
    assert weather(fields) == ("fog 0.25 /m", "rain 5 mm/h", "volume plume")
    assert weather({}) == ()


def test_list_names_scenes_and_families() -> None:
    run = CliRunner().invoke(app, ["scenes", "list"], env={"COLUMNS": "120"})
    assert run.exit_code == 0
    for name in (*list_scenes(), *FAMILIES):
        assert name in run.stdout
    run = CliRunner().invoke(app, ["scenes", "list", "--json"])
    report = json.loads(run.stdout)
    assert [scene["name"] for scene in report["scenes"]] == list_scenes()
    assert report["scenes"][list_scenes().index("warehouse")]["weather"] == ["fog 200 m"]
    assert set(report["families"]) == set(FAMILIES)


def test_the_page_is_made_from_what_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_gallery, "catalogue", lambda: catalogue()[-1:])
    monkeypatch.setattr(scene_gallery, "FAMILIES", {"targets": FAMILIES["targets"]})
    monkeypatch.setattr(scene_gallery, "SEEDS", range(1))
    page = tmp_path / "reference" / "scene-gallery.md"
    page.parent.mkdir()
    page.write_text("a<!-- library --><!-- /library -->b<!-- families -->old<!-- /families -->c")
    scene_gallery.main(tmp_path)
    text = page.read_text()
    assert "old" not in text
    name = catalogue()[-1].name
    for picture in (name, "targets-0"):
        assert f"![{picture}](../images/scenes/{picture}.jpg)" in text
        size = (tmp_path / "images" / "scenes" / f"{picture}.jpg").stat().st_size
        assert 500 < size < 40_000


def test_a_page_without_marks_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scene_gallery, "catalogue", list)
    monkeypatch.setattr(scene_gallery, "FAMILIES", {})
    monkeypatch.setattr(scene_gallery, "_show", lambda *_: None)
    page = tmp_path / "reference" / "scene-gallery.md"
    page.parent.mkdir()
    page.write_text("nothing")
    with pytest.raises(InputError, match="lacks the marks"):
        scene_gallery.main(tmp_path)


def test_every_picture_of_the_page_exists_and_is_small() -> None:
    text = (DOCS / "reference" / "scene-gallery.md").read_text(encoding="utf-8")
    named = {part.split(")")[0] for part in text.split("](../images/")[1:]}
    assert named
    sizes = [(DOCS / "images" / name).stat().st_size for name in named]
    assert sum(sizes) < 1_500_000
