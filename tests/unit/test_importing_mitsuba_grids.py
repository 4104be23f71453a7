"""Grid media and pictures of all around of Mitsuba scenes, held against Mitsuba itself."""

import re
import struct
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from scipy.ndimage import map_coordinates

from foreign import taken
from spisim.scene import Volume
from spisim.transport.backend import activate

RNG = np.random.default_rng(3)
SIGMA = RNG.random((3, 4, 5)).astype(np.float32) * 4
ALBEDO = RNG.random((3, 4, 5)).astype(np.float32)


@pytest.fixture(autouse=True)
def scalar():
    """Mitsuba without a compiler, for once."""
    before = activate()
    mi.set_variant("scalar_rgb")
    yield
    mi.set_variant(before)


def write_volume(path: Path, values: np.ndarray, *, cut: int = 0, kind: int = 1) -> None:
    nz, ny, nx = values.shape[:3]
    channels = 1 if values.ndim == 3 else values.shape[3]
    head = b"VOL\x03" + struct.pack("<5i6f", kind, nx, ny, nz, channels, *[0] * 3, *[1] * 3)
    data = head + values.astype("<f4").tobytes()
    path.write_bytes(data[: len(data) - cut])


def grid(name: str, file: str, steps: str = "") -> str:
    return (
        f'<volume type="gridvolume" name="{name}"><string name="filename" value="{file}"/>'
        f'<transform name="to_world">{steps}</transform></volume>'
    )


def scene(path: Path, inside: str, steps: str = "", shape: str = "cube") -> Path:
    medium = f'<medium type="heterogeneous" name="interior" id="smoke">{inside}</medium>'
    path.write_text(
        f'<scene version="3.0.0"><shape type="{shape}">{medium}<bsdf type="null"/>'
        f'<transform name="to_world">{steps}</transform></shape>'
        '<shape type="rectangle"><transform name="to_world"><translate z="-5"/></transform>'
        "</shape></scene>"
    )
    return path


def extinction(volume: Volume, points: np.ndarray) -> np.ndarray:
    """At world points (n, 3), in cells' middles linear."""
    from scipy.interpolate import RegularGridInterpolator

    assert volume.density is not None
    local = points @ np.linalg.inv(volume.to_world)[:3, :3].T
    local += np.linalg.inv(volume.to_world)[:3, 3]
    axes = [(np.arange(n) + 0.5) / n for n in volume.density.shape]
    inside = [np.clip(c, a[0], a[-1]) for c, a in zip(local[:, ::-1].T, axes, strict=True)]
    result = RegularGridInterpolator(axes, volume.density)(np.column_stack(inside))
    return result * volume.medium.extinction_per_m


#: The cube of Mitsuba goes from -1 to 1, a grid from 0 to 1.
SAME = '<scale value="2"/><translate x="-1" y="-1" z="-1"/>'
POSE = '<scale x="2" y="3" z="0.5"/><rotate z="1" angle="30"/><translate x="7"/>'


def test_a_grid_that_fills_its_box(tmp_path: Path) -> None:
    """Exactly, with the box's pose, ten times as large."""
    write_volume(tmp_path / "s.vol", SIGMA)
    inside = grid("sigma_t", "s.vol", SAME + POSE) + '<float name="scale" value="5"/>'
    report = taken(scene(tmp_path / "a.xml", inside, POSE), scale=10.0)
    (volume,) = report.written.scene.volumes
    assert volume.density is not None
    assert volume.medium.albedo == pytest.approx(0.75)
    assert volume.density.shape == SIGMA.shape
    np.testing.assert_allclose(
        volume.density * volume.medium.extinction_per_m, SIGMA * 5 / 10, rtol=1e-5
    )
    taken(tmp_path / "a.xml", overwrite=True)


@pytest.mark.parametrize(("shape", "tolerance"), [("cube", 0.25), ("sphere", 0.25)])
def test_a_grid_elsewhere(tmp_path: Path, shape: str, tolerance: float) -> None:
    """Turned against its box, or in a mesh: as Mitsuba evaluates it, but for the finer cells."""
    smooth = np.fromfunction(lambda z, y, x: 1 + x + 2 * y + 3 * z, (6, 5, 4), dtype=float)
    write_volume(tmp_path / "s.vol", smooth)
    steps = '<scale value="4"/><translate x="-2" y="-2" z="-2"/><rotate x="1" angle="20"/>'
    file = scene(tmp_path / "a.xml", grid("sigma_t", "s.vol", steps), "", shape)
    (volume,) = taken(file).written.scene.volumes
    turn = mi.ScalarTransform4f().rotate([1, 0, 0], 20).translate([-2, -2, -2]).scale(4)
    theirs = mi.load_dict(
        {"type": "gridvolume", "filename": str(tmp_path / "s.vol"), "to_world": turn}
    )
    points = RNG.uniform(-0.5, 0.5, (30, 3))
    expected = []
    for point in points:
        position = mi.Interaction3f()
        position.p = point.tolist()
        expected.append(theirs.eval_1(position))
    np.testing.assert_allclose(extinction(volume, points), expected, atol=tolerance)


def test_a_rough_grid_moved_against_its_box(tmp_path: Path) -> None:
    """Full and empty cells side by side."""
    rng = np.random.default_rng(8)
    rough = 5.0 * (rng.random((6, 6, 6)) < 0.3)
    write_volume(tmp_path / "s.vol", rough)
    moved = '<scale value="3"/><translate x="-1.3" y="-1.4" z="-1.6"/>'
    file = scene(tmp_path / "a.xml", grid("sigma_t", "s.vol", moved))
    (volume,) = taken(file).written.scene.volumes
    points = rng.uniform(-1, 1, (4000, 3))
    cells = (points - [-1.3, -1.4, -1.6]) * 2 - 0.5
    exact = map_coordinates(rough, cells[:, ::-1].T, order=1, mode="nearest")
    result = extinction(volume, points)
    assert result.mean() == pytest.approx(exact.mean(), rel=1e-3)
    assert np.sqrt(np.mean((result - exact) ** 2)) < 0.01 * 5


def test_albedo_on_a_grid(tmp_path: Path) -> None:
    """One volume scatters and one absorbs: together they have extinction and albedo of both."""
    write_volume(tmp_path / "s.vol", SIGMA)
    write_volume(tmp_path / "w.vol", np.stack([ALBEDO, 0 * ALBEDO, 0 * ALBEDO], axis=-1))
    inside = grid("sigma_t", "s.vol", SAME) + grid("albedo", "w.vol", SAME)
    scattering, absorbing = taken(scene(tmp_path / "a.xml", inside)).written.scene.volumes
    assert absorbing.medium.albedo == 0
    parts = [volume.density * volume.medium.extinction_per_m for volume in (scattering, absorbing)]
    np.testing.assert_allclose(sum(parts), SIGMA, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(
        parts[0] * scattering.medium.albedo, SIGMA * ALBEDO, rtol=1e-4, atol=1e-6
    )


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda path: write_volume(path, SIGMA, cut=8), "cut off"),
        (lambda path: write_volume(path, SIGMA, kind=2), "kind 2"),
        (lambda path: write_volume(path, -SIGMA), "from 0 on"),
        (lambda path: path.write_bytes(b"VOL"), "no grid"),
        (lambda path: path.unlink(missing_ok=True), "no file"),
    ],
)
def test_damaged_grids(tmp_path: Path, spoil, message: str) -> None:
    spoil(tmp_path / "s.vol")
    report = taken(scene(tmp_path / "a.xml", grid("sigma_t", "s.vol")))
    assert any(re.search(message, note) for note in report.notes)
    assert not report.written.scene.volumes
    assert len(report.written.scene.objects) == 1


@pytest.mark.parametrize("steps", ["", '<scale x="-1"/>', '<rotate x="1" y="2" angle="70"/>'])
def test_pictures_of_all_around(tmp_path: Path, steps: str) -> None:
    """Radiance in the middle of every pixel, as Mitsuba has it."""
    red = RNG.random((6, 8)).astype(np.float32) + 0.1
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"R": red, "G": 0 * red, "B": 0 * red}).write(str(tmp_path / "b.exr"))
    (tmp_path / "a.xml").write_text(
        '<scene version="3.0.0"><shape type="cube"/><emitter type="envmap"><string name="filename" '
        f'value="b.exr"/><float name="scale" value="3"/><transform name="to_world">{steps}'
        "</transform></emitter></scene>"
    )
    report = taken(tmp_path / "a.xml", lamps="watts", up="z")
    (lamp,) = report.written.scene.lamps
    theirs = mi.load_dict({
        "type": "envmap", "bitmap": mi.Bitmap(np.stack([red, 0 * red, 0 * red], axis=-1)),
        "scale": 3.0,
        "to_world": {
            "": mi.ScalarTransform4f(),
            '<scale x="-1"/>': mi.ScalarTransform4f().scale([-1, 1, 1]),
        }.get(steps, mi.ScalarTransform4f().rotate([1 / 5**0.5, 2 / 5**0.5, 0], 70)),
    })  # fmt: skip
    mi.load_dict({"type": "scene", "lamp": theirs, "shape": {"type": "sphere"}})
    height, width = lamp.picture.shape
    for row, column in [(0, 0), (1, 5), (2, 2), (5, 7), (3, 6)]:
        polar, azimuth = (row + 0.5) / height * np.pi, (column + 0.5) / width * 2 * np.pi
        local = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
        seen = mi.SurfaceInteraction3f()
        seen.wi = (-(lamp.to_world @ local)).tolist()
        value = lamp.radiance.amount * lamp.picture[row, column]
        assert value == pytest.approx(theirs.eval(seen)[0], rel=2e-3), (row, column)


def test_pictures_of_all_around_keep_what_each_row_sends(tmp_path: Path) -> None:
    """Between dark rows a bright one is as bright on the whole as by straight lines from the poles.

    The middles of pixels do not tell: bands cut the corners between them.
    """
    red = np.full((9, 4), 0.1, np.float32)
    red[4] = 20.0
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"R": red, "G": red, "B": red}).write(str(tmp_path / "b.exr"))
    (tmp_path / "a.xml").write_text(
        '<scene version="3.0.0"><shape type="cube"/><emitter type="envmap"><string name="filename" '
        'value="b.exr"/></emitter></scene>'
    )
    (lamp,) = taken(tmp_path / "a.xml", lamps="watts", up="z").written.scene.lamps
    picture = lamp.radiance.amount * lamp.picture[:, 0]
    polar = (np.arange(8000) + 0.5) / 1000  # in rows of the file, 1000 places for each
    seen = np.interp(polar / 8, (np.arange(len(picture)) + 0.5) / len(picture), picture)
    there = np.interp(polar, np.arange(9), red[:, 0])
    each = [float(values[500:-500].reshape(7, 1000).mean(axis=1)[2]) for values in (seen, there)]
    assert each[0] == pytest.approx(each[1], rel=0.005)  # a dark row beside the bright one
    assert seen.mean() == pytest.approx(there.mean(), rel=1e-3)


def test_a_missing_picture_of_all_around_is_a_note(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(
        '<scene version="3.0.0"><shape type="cube"/><emitter type="envmap"><string name="filename" '
        'value="gone.exr"/></emitter></scene>'
    )
    report = taken(tmp_path / "a.xml", lamps="watts")
    assert not report.written.scene.lamps
    assert any("gone.exr" in note and "left out" in note for note in report.notes)


def test_other_ways_between_cells_are_told(tmp_path: Path) -> None:
    write_volume(tmp_path / "s.vol", RNG.random((2, 3, 4)))
    ways = '<string name="filter_type" value="nearest"/><string name="wrap_mode" value="repeat"/>'
    inside = grid("sigma_t", "s.vol").replace("</volume>", f"{ways}</volume>")
    notes = " ".join(taken(scene(tmp_path / "a.xml", inside)).notes)
    assert "its grid of sigma_t is nearest there" in notes
    assert "repeated there beyond its box" in notes
