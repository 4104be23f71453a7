"""Import of Mitsuba scenes: emitters and media."""

import re
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import trimesh

from foreign import taken
from mitsuba_scenes import scene, shape, turned

MEDIUM = (
    '<medium type="homogeneous" name="interior" id="haze"><rgb name="sigma_t" value="0.4 8 9"/>'
    '<float name="scale" value="2"/><rgb name="albedo" value="0.9 0.1 0.1"/>'
    '<phase type="hg"><float name="g" value="0.7"/></phase></medium>'
)


def test_media_in_boxes(tmp_path: Path) -> None:
    """Of red; the null surface around is a hole, and the box stands as it did."""
    steps = '<scale x="2" y="3" z="0.5"/><rotate z="1" angle="30"/><translate x="7"/>'
    body = shape("cube", MEDIUM + '<bsdf type="null"/>', steps) + shape("rectangle")
    report = taken(scene(tmp_path / "a.xml", body), scale=10.0)
    (volume,) = report.written.scene.volumes
    assert [thing.name for thing in report.written.scene.objects] == ["rectangle"]
    assert volume.medium.extinction_per_m == pytest.approx(0.08)
    assert volume.medium.albedo == pytest.approx(0.9)
    assert volume.medium.g == pytest.approx(0.7)
    corner = volume.to_world @ [1, 1, 1, 1]
    expected = turned([0, 0, 1], 30) @ [20, 30, 5, 1] + [70, 0, 0, 0]
    np.testing.assert_allclose(corner, expected, atol=1e-5)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        (shape("sphere", MEDIUM), "0.8 per unit, albedo 0.9, g 0.7 .* is a volume"),
        (shape("rectangle", MEDIUM), "left out, mesh 'rectangle' is not closed"),
        (shape("cube", MEDIUM.replace("0.4 8 9", "0 8 9")), "has no extinction"),
        (shape("cube", '<emitter type="area"><rgb name="radiance" value="3 2 1"/></emitter>'),
         "area emitter on 'cube': radiance 3, 2, 1 has no unit; as watts 3 "),
        (shape("cube") + '<emitter type="spot"/>', "spot emitter: .* as watts 1 W/sr"),
        (shape("cube") + '<emitter type="spot"/>', "lamps: 1, all left out: .* --lamps watts"),
        (shape("cube") + '<emitter type="constant"/>', r"constant emitter: .* W/\(m² sr\)"),
        (shape("cube") + '<emitter type="projector"/>', "projector emitter: .* left out"),
        (shape("cube", '<emitter type="area"><texture type="checkerboard" name="radiance"/>'
               "</emitter>"), "area emitter on 'cube': .* is left out, which is no number"),
        (shape("cube", '<emitter type="area"><texture type="bitmap" name="radiance"><string '
               'name="filename" value="gone.exr"/></texture></emitter>'),
         "area emitter on 'cube': .* is left out: .*no file 'gone.exr'"),
    ],
)  # fmt: skip
def test_light_and_media_that_are_told(tmp_path: Path, body: str, message: str) -> None:
    report = taken(scene(tmp_path / "a.xml", body))
    notes = report.notes + report.warnings
    assert any(re.search(message, note) for note in notes), notes


def test_lamps_and_media_in_meshes(tmp_path: Path) -> None:
    """Ten times as large, and lit as brightly; y is up as the sensor has it."""
    sensor = (
        '<sensor type="perspective"><transform name="to_world">'
        '<lookat origin="0, 0, 9" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>'
    )
    light = '<emitter type="area"><float name="radiance" value="3"/></emitter>'
    body = (
        shape("sphere", MEDIUM + '<bsdf type="null"/>', '<translate y="2"/>')
        + shape("cube", light)
        + '<emitter type="point"><point name="position" x="0" y="4" z="0"/>'
        '<float name="intensity" value="5"/></emitter>'
        '<emitter type="spot"><float name="cutoff_angle" value="30"/><transform name="to_world">'
        '<lookat origin="0, 3, 0" target="0, 0, 0" up="1, 0, 0"/></transform></emitter>'
        '<emitter type="directional"><vector name="direction" x="0" y="-2" z="0"/></emitter>'
        '<emitter type="constant"><float name="radiance" value="0.5"/></emitter>'
    )
    file = scene(tmp_path / "a.xml", sensor + body)
    assert not taken(file).written.scene.lamps
    report = taken(file, scale=10.0, lamps="watts", overwrite=True)
    assert any("lamps: 5, their numbers taken for watts" in note for note in report.notes)
    result = report.written.scene
    (volume,) = result.volumes
    assert isinstance(volume.shape, trimesh.Trimesh)
    np.testing.assert_allclose(
        volume.shape.bounds, [[-10, -10, 10], [10, 10, 30]], atol=0.05, rtol=0
    )
    assert volume.medium.extinction_per_m == pytest.approx(0.08)
    lamps = {lamp.summary()["type"]: lamp for lamp in result.lamps}
    assert lamps["area"].object == "cube"
    assert lamps["area"].radiance.amount == pytest.approx(3)
    np.testing.assert_allclose(lamps["point"].position_m, [0, 0, 40], atol=1e-6)
    assert lamps["point"].intensity.amount == pytest.approx(500)
    np.testing.assert_allclose(lamps["spot"].position_m, [0, 0, 30], atol=1e-6)
    np.testing.assert_allclose(lamps["spot"].direction, [0, 0, -1], atol=1e-6)
    assert np.degrees(lamps["spot"].beam_rad) == pytest.approx(22.5)
    np.testing.assert_allclose(lamps["directional"].direction, [0, 0, -1], atol=1e-6)
    assert lamps["environment"].radiance.amount == pytest.approx(0.5)


def test_a_shining_picture_is_its_mean(tmp_path: Path) -> None:
    """Linear red, which may be above 1."""
    red = np.array([[0.0, 9.0], [1.0, 2.0]], np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"R": red, "G": 0 * red, "B": 0 * red}).write(str(tmp_path / "b.exr"))
    light = (
        '<emitter type="area"><texture type="bitmap" name="radiance"><string name="filename" '
        'value="b.exr"/></texture></emitter>'
    )
    report = taken(scene(tmp_path / "a.xml", shape("cube", light)), lamps="watts")
    (lamp,) = report.written.scene.lamps
    assert lamp.radiance.amount == pytest.approx(3.0, rel=1e-3)
    assert any("watts 3 W/(m² sr), the mean of its picture's red" in n for n in report.notes)


@pytest.mark.parametrize(
    ("emitter", "ambient"),
    [
        ('<emitter type="sunsky"><vector name="sun_direction" x="0" y="1" z="0"/></emitter>',
         (100, (0, 0, -1), 20)),
    ],
)  # fmt: skip
def test_suns(tmp_path: Path, emitter: str, ambient: tuple) -> None:
    """In the world, where y was up."""
    report = taken(scene(tmp_path / "a.xml", emitter + shape("cube")), up="y")
    got = report.written.scene.ambient
    assert (got.sun_klx, got.sky_klx) == (ambient[0], ambient[2])
    np.testing.assert_allclose(got.sun_direction, ambient[1], atol=1e-9)
