"""Files that scenes, instruments and flights name: wherever they lie, and only what they may be."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hostile
from commands import mistake
from foreign import tetrahedron
from reconstruction import Capture, write_capture
from reconstruction.base.errors import InputError
from reconstruction.base.files import mark
from spisim.base.config.files import EnclosedFolder, read_columns, read_density, read_picture
from spisim.instrument import load_instrument
from spisim.scene import load_scene, load_trajectory, make_scene
from spisim.scene.shapes import load_mesh
from spisim_inverse.fit.written import INSTRUMENT

SECRET = "hunter2"
SCENE = """
name: s
drone: {position_m: [0, 0, 0], look_at_m: [1, 0, 0]}
objects:
  - {name: wall, shape: box, size_m: [0.1, 8, 8], material: concrete, translate_m: [6, 0, 0]}
"""
READERS: dict[str, Callable[[Path], object]] = {
    "scene.yaml": load_scene,
    "instrument.yaml": load_instrument,
    "flight.csv": load_trajectory,
    "mesh.ply": load_mesh,
    "mesh.obj": load_mesh,
    "mesh.stl": load_mesh,
    "mesh.off": load_mesh,
    "picture.png": read_picture,
    "picture.npy": read_picture,
    "density.npy": read_density,
    "table.csv": read_columns,
    "table.npy": read_columns,
}


def scene_with(folder: Path, mesh: str) -> Path:
    row = f"  - {{name: thing, mesh: {mesh}, material: concrete, translate_m: [3, 0, 0]}}\n"
    file = folder / "scene.yaml"
    file.write_text(SCENE + row)
    return file


@pytest.mark.parametrize("where", ["../shared/thing.ply", "{folder}/shared/thing.ply"])
def test_a_scene_may_name_a_mesh_anywhere(tmp_path: Path, where: str) -> None:
    """In an import it may not: see test_importing_refused.py."""
    for name in ("shared", "mine"):
        (tmp_path / name).mkdir()
    tetrahedron().export(tmp_path / "shared" / "thing.ply")
    scene = load_scene(scene_with(tmp_path / "mine", where.format(folder=tmp_path)))
    assert [len(thing.mesh.faces) for thing in scene.objects] == [12, 4]


@pytest.mark.parametrize("name", READERS)
def test_devices_and_pipes_are_not_read(tmp_path: Path, name: str) -> None:
    """A pipe would wait for ever, and zeros would never end."""
    (tmp_path / "zero").mkdir()
    (tmp_path / "zero" / name).symlink_to("/dev/zero")
    os.mkfifo(tmp_path / name)

    def attack(number: int) -> None:
        file = tmp_path / ("zero" if number else "") / name
        with pytest.raises(InputError, match="not a regular file"):
            READERS[name](file)

    hostile.survive(attack, range(2), readable=[tmp_path])


@pytest.mark.parametrize("name", list(READERS)[3:])
def test_what_a_named_file_holds_is_never_told(tmp_path: Path, name: str) -> None:
    for text in (f"root:{SECRET}:0:0\n{SECRET},{SECRET}\n", f"f {SECRET} v {SECRET}\nv {SECRET}\n",
                 f"ply\nformat ascii 1.0\nelement vertex {SECRET}\n{SECRET}\nend_header\n{SECRET}",
                 f"solid\nfacet normal {SECRET}\nvertex {SECRET}", f"OFF\n{SECRET} {SECRET} 0\n",
                 f"\x93NUMPY\x01\x00v\x00{{'{SECRET}': 3}}"):  # fmt: skip
        (tmp_path / name).write_text(text, encoding="latin-1")
        with pytest.raises(InputError) as reported:
            READERS[name](tmp_path / name)
        assert SECRET not in str(reported.value)
        assert "\n" not in str(reported.value)


@pytest.mark.parametrize("name", ["id_rsa", "notes.txt", "data"])
def test_files_by_other_names_are_no_scenes(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(SECRET)
    for load in (load_scene, load_instrument, read_columns, load_mesh, read_picture):
        with pytest.raises(InputError) as reported:
            load(tmp_path / name)  # type: ignore[operator]
        assert SECRET not in str(reported.value)


def test_a_large_text_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "large.yaml").open("wb") as file:
        file.truncate(10**9)
    with pytest.raises(InputError, match="954 MB; at most 64 MB of text"):
        load_scene(tmp_path / "large.yaml")


def test_an_array_that_is_larger_than_its_file(tmp_path: Path) -> None:
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (4000, 4000, 4000), }"
    header += b" " * (117 - len(header)) + b"\n"
    (tmp_path / "bomb.npy").write_bytes(b"\x93NUMPY\x01\x00\x76\x00" + header)

    def attack(_: int) -> None:
        with pytest.raises(InputError, match="states 512000000000 bytes of at most"):
            read_density(tmp_path / "bomb.npy")

    hostile.survive(attack, [0], readable=[tmp_path])


def test_a_sound_array_is_read(tmp_path: Path) -> None:
    np.save(tmp_path / "sound.npy", np.ones((2, 3, 4)))
    assert read_density(tmp_path / "sound.npy").shape == (2, 3, 4)
    shutil.copy(tmp_path / "sound.npy", tmp_path / "read-only.npy")
    (tmp_path / "read-only.npy").chmod(0o400)
    assert read_density(tmp_path / "read-only.npy").all()


def test_a_recorded_scene_opens_nothing_outside_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    tetrahedron().export(tmp_path / "secret.ply")
    tetrahedron().export(tmp_path / "in" / "own.ply")
    (tmp_path / "in" / "link.ply").symlink_to(tmp_path / "secret.ply")
    folder = EnclosedFolder(tmp_path / "in")
    for name in ("../secret.ply", str(tmp_path / "secret.ply"), "link.ply", "../none.ply"):
        text = f"{SCENE}  - {{name: t, mesh: {name}, material: concrete, translate_m: [3, 0, 0]}}"
        with pytest.raises(InputError, match=r"lies outside of .*in, and is not opened"):
            make_scene(text, folder, "its scene")
    assert (folder / "own.ply").is_file()


@pytest.mark.parametrize("overwrite", [[], ["--overwrite"]])
def test_a_fit_does_not_replace_its_instrument(
    overwrite: list[str], capture: Capture, tmp_path: Path
) -> None:
    write_capture(capture, tmp_path / "a.h5")
    mine = tmp_path / "mine.yaml"
    mine.write_text(f"# {mark(INSTRUMENT)}\n{load_instrument('paper').text}")
    before = mine.read_bytes()
    words = ["--scene", "target-plane", "--free", "projector.power_w", "--instrument", str(mine)]
    said = mistake("fit", tmp_path / "a.h5", *words, "--output-instrument", mine, *overwrite)
    assert "mine.yaml is read by this command; give its output another name" in said
    assert mine.read_bytes() == before
