"""Looking at a scene before it is simulated: what is where, and a picture of it."""

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from matplotlib.image import imread
from typer.testing import CliRunner

import spisim
from instruments import changed
from scenefiles import MINIMAL
from spisim.scene import Material, SceneObject, look_at
from spisim.scene.layout import OFFERED, Layout
from spisim.transport import RayCaster, ground_truth
from spisim_app.cli import app
from spisim_app.report.scene_view import Look, picture, survey
from spisim_app.report.scene_view.cameras import MAX_CUT_M, Section, cut_m, heading
from worlds import plane, scene, surface

AHEAD = np.array([[0.0, 0.0, 1.0]])
HERE = np.zeros((1, 3))


def show(*arguments: str | Path) -> Any:
    return CliRunner().invoke(app, ["scenes", "show", *map(str, arguments)], env={"COLUMNS": "100"})


def test_sight_finds_the_first_surface_and_says_where_there_is_none() -> None:
    caster = RayCaster.of(scene(plane(5), plane(3, half_size_m=1.0)))
    rays = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.0, -1.0]])
    result = caster.along(np.zeros((3, 3)), rays)
    assert result.object_id.tolist() == [1, 0, -1]
    assert result.range_m[:2] == pytest.approx([3, 5 / 0.8], rel=1e-6)
    assert np.isinf(result.range_m[2])


def test_brightness_follows_reflectance_and_hidden_sky() -> None:
    """An open plane seen straight on is as bright as the square root of its reflectance."""
    open_wall = RayCaster.of(scene(plane(5, 0.25)))
    assert open_wall.shaded(HERE, AHEAD)[0] == pytest.approx(0.5, abs=0.01)
    lid = plane(5.05, 0.25, half_size_m=3.0)
    covered = RayCaster.of(scene(plane(5.3, 0.25), lid))
    beside_lid = np.array([[3.2, 0.0, 5.0]]), AHEAD
    assert 0.1 < covered.shaded(*beside_lid)[0] < 0.48
    assert np.isnan(open_wall.shaded(HERE, -AHEAD)[0])


def test_what_sends_no_light_back_is_looked_through() -> None:
    nothing = Material("nothing", 0.0, "test", opacity=0.0)
    pane = SceneObject("pane", plane(2).mesh, nothing)
    caster = RayCaster.of(scene(plane(5, 0.25), pane))
    assert caster.shaded(HERE, AHEAD)[0] == pytest.approx(0.5, abs=0.01)
    assert caster.along(HERE, AHEAD).object_id.tolist() == [0]


def test_survey_agrees_with_the_truth() -> None:
    position, instrument = spisim.load_scene("warehouse"), spisim.load_instrument("paper")
    result = survey(position, instrument, RayCaster.of(position))
    truth = ground_truth(position, instrument)
    assert [spot.object for spot in result.spots] == list(truth.spot_object)
    assert [spot.range_m for spot in result.spots] == pytest.approx(truth.spot_range_m, rel=1e-5)
    assert result.nearest.range_m == pytest.approx(np.nanmin(truth.range_m), rel=0.005)
    assert result.nearest.object == "drum"
    assert result.farthest.range_m == pytest.approx(np.nanmax(truth.range_m), rel=0.005)
    assert result.clearance_m == pytest.approx(1.6)  # above the floor
    assert result.problem is None


def test_survey_of_a_scene_that_the_spots_miss() -> None:
    block = surface("block", trimesh.creation.box((0.2, 0.2, 0.2)), 0.5)
    position = replace(scene(block), drone_pose=look_at((0, 0, 3), (9, 0, 3), (0, 0, 1)))
    result = survey(position, spisim.load_instrument("paper"), RayCaster.of(position))
    assert all(spot.object is None and np.isinf(spot.range_m) for spot in result.spots)
    assert result.nearest.object is None
    assert np.isnan(result.nearest_m).all()
    assert result.problem is not None
    assert "laser spot" in result.problem


def test_a_sheet_that_is_turned_has_no_thickness(tmp_path: Path) -> None:
    (tmp_path / "sheet.yaml").write_text(MINIMAL)
    position = spisim.load_scene(tmp_path / "sheet.yaml")
    result = survey(position, spisim.load_instrument("paper"), RayCaster.of(position))
    assert result.extents_m == (0, 4, 4)


def test_clearance_is_the_distance_to_the_nearest_of_all_triangles() -> None:
    rng = np.random.default_rng(2)
    triangles = rng.normal(size=(500, 1, 3)) * 3 + rng.normal(size=(500, 3, 3))
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles), process=False)
    nearest = trimesh.triangles.closest_point(triangles, np.zeros((500, 3)))
    distance = np.linalg.norm(nearest, axis=1).min()
    soup = scene(surface("soup", mesh, 0.5))
    assert Layout(soup, OFFERED).clearance_m == pytest.approx(distance)


def test_a_section_shows_points_where_its_rays_meet_them() -> None:
    """The ray of the pixel in which a point is drawn leads to the point."""
    section = Section(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 0.0]), np.array([0, 0, 1.0]))
    point = np.array([-4.0, 3.05, 2.55])
    assert section.into == pytest.approx([-1, 0, 0])
    assert section.project(point) == pytest.approx([1.05, -0.45])
    origins, directions = section.rays((10, 20), (0, 2, -1, 0), cut_m=0.5)
    row, column = 4, 10
    origin, towards = origins[20 * row + column], directions[20 * row + column]
    assert origin[0] == pytest.approx(1.5)
    assert np.cross(point - origin, towards) == pytest.approx(np.zeros(3), abs=1e-12)


def test_sections_are_cut_below_a_ceiling() -> None:
    ceiling = trimesh.creation.box((9, 9, 0.1)).apply_translation((0, 0, 1.05))
    up = np.array([0.0, 0.0, 1.0])
    assert cut_m(RayCaster.of(scene(surface("c", ceiling, 0.5))), np.zeros(3), up) == pytest.approx(
        0.5
    )
    assert cut_m(RayCaster.of(scene(plane(-5))), np.zeros(3), up) == MAX_CUT_M


def test_heading_is_level() -> None:
    assert heading(look_at((0, 0, 5), (3, 4, 0), (0, 0, 1))) == pytest.approx([0.6, 0.8, 0])
    assert heading(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0))) == pytest.approx([0, 1, 0])


def test_show_draws_and_tells(tmp_path: Path) -> None:
    picture = tmp_path / "new" / "view.png"
    run = show("warehouse", "-o", picture, "--json")
    assert run.exit_code == 0, run.output
    report = json.loads(run.stdout)
    assert report["written"] == [str(picture)]
    assert [spot["object"] for spot in report["spots"]] == [
        "crate-1",
        "overall",
        "drum",
        "carton-3",
    ]
    assert report["triangles"] == 12086
    assert report["media"][0]["visibility_m"] == 200
    pixels = imread(picture)
    assert pixels.shape[:2] == (720, 1320)
    assert 0.2 < pixels[..., :3].mean() < 0.95
    assert pixels[..., :3].std() > 0.1


def test_texts_in_the_view_do_not_overlap(monkeypatch: pytest.MonkeyPatch) -> None:
    """The nearest point is put on, above and below the number of a spot."""
    monkeypatch.setattr(picture, "_picture", lambda *_: np.zeros((1, 1, 3)))
    position, instrument = spisim.load_scene("target-plane"), spisim.load_instrument("paper")
    caster = RayCaster.of(position)
    result = survey(position, instrument, caster)
    for shift in (-0.06, -0.03, 0.0, 0.03):
        ray = instrument.lasers.directions[0] + (0, shift, 0)
        nearest_m = position.drone_pose[:3, 3] + 4 * position.drone_pose[:3, :3] @ ray
        look = Look(position, instrument, caster, replace(result, nearest_m=nearest_m))
        texts = picture.look_figure(look).axes[0].texts
        boxes = [text.get_window_extent() for text in texts]
        assert any("nearest" in text.get_text() for text in texts)
        assert all(not a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def test_show_of_a_drawn_scene_warns_of_what_makes_it_useless(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scene file of a person's own may have nothing where the spots go; it is shown all the
    same, into the current folder."""
    (tmp_path / "ball.yaml").write_text(
        "name: ball\ndrone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}\n"
        "objects: [{name: ball, shape: sphere, radius_m: 0.2, material: cardboard,"
        " translate_m: [5, 0, 1]}]\n"
    )
    monkeypatch.chdir(tmp_path)
    run = show("ball.yaml")
    assert run.exit_code == 0, run.output
    assert "spot 0 meets nothing within 9.8 m" in run.stderr
    assert "4.800" in run.stdout
    assert (tmp_path / "ball.png").is_file()


def test_scenes_are_shown_with_nine_spots(tmp_path: Path) -> None:
    nine = changed(
        "paper",
        lasers__directions_deg=[[x, y] for x in (-5, 0, 5) for y in (-5, 0, 5)],
        tof__detector__positions_m=[[0.01, 0, 0]] * 9,
    )
    (tmp_path / "nine.yaml").write_text(nine.text, encoding="utf-8")
    run = show(
        "target-plane", "--instrument", tmp_path / "nine.yaml", "-o", tmp_path / "x.png", "--json"
    )
    assert run.exit_code == 0, run.output
    assert len(json.loads(run.stdout)["spots"]) == 9
    assert (tmp_path / "x.png").is_file()


def test_mistakes_are_told_before_the_work(tmp_path: Path) -> None:
    for arguments, words in (
        (("warehous", "-o", tmp_path / "x.png"), "did you mean 'warehouse'"),
        (("warehouse", "-o", tmp_path), "is a folder"),
        (("warehouse", "-o", tmp_path / "x.png", "--instrument", "papr"), "did you mean 'paper'"),
    ):
        run = show(*arguments)
        assert run.exit_code == 2
        assert words in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_nearest_point_lies_where_the_nearest_surface_is() -> None:
    position = replace(scene(plane(4)), drone_pose=look_at((1, 0, 0), (1, 0, 9), (0, 1, 0)))
    result = survey(position, spisim.load_instrument("paper"), RayCaster.of(position))
    assert result.nearest_m[2] == pytest.approx(4, abs=1e-3)
    assert result.nearest_m[0] == pytest.approx(1, abs=0.1)
