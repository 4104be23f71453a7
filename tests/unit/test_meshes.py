"""Mesh files: the shipped ones are what their script makes, unusable ones are refused."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from reconstruction.base.errors import InputError
from spisim.scene import scenes_folder
from spisim.scene.shapes import load_mesh
from spisim_worlds.parts import props

SHIPPED = sorted((scenes_folder() / "meshes").glob("*.ply"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_mesh_is_what_its_script_makes(path: Path) -> None:
    shipped, made = load_mesh(path), getattr(props, path.stem)()
    np.testing.assert_array_equal(shipped.faces, made.faces)
    np.testing.assert_allclose(shipped.vertices, made.vertices, atol=1e-6)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_mesh_is_small_closed_and_stands_on_the_floor(path: Path) -> None:
    mesh = load_mesh(path)
    mesh.merge_vertices()
    assert path.stat().st_size < 50_000
    assert mesh.is_winding_consistent
    assert mesh.volume > 0  # normals face out
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=0.02) or path.stem.startswith("worker")


def write_ply(path: Path, vertices: list[str], faces: list[str]) -> Path:
    header = (
        "ply\nformat ascii 1.0\n"
        f"element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_text(header + "\n".join(vertices + faces) + "\n")
    return path


def test_triangles_come_as_they_stand_in_the_file(tmp_path: Path) -> None:
    path = write_ply(tmp_path / "one.ply", ["0 0 0", "1 0 0", "0 1 0"], ["3 0 1 2"])
    mesh = load_mesh(path)
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert mesh.area == pytest.approx(0.5)


@pytest.mark.parametrize("suffix", ["obj", "stl", "off", "PLY"])
def test_other_formats(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"box.{suffix}"
    trimesh.creation.box((1, 2, 3)).export(path)
    assert load_mesh(path).volume == pytest.approx(6)


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (["0 0 0", "1 0 0", "0 nan 0"], ["3 0 1 2"], "not finite"),
        (["0 0 0", "inf 0 0", "0 1 0"], ["3 0 1 2"], "not finite"),
        (["0 0 0", "1 0 0", "0 1 0"], [], "empty"),
        ([], [], "empty"),
        (["0 0 0", "1 0 0", "0 1 0"], ["3 0 1 7"], "damaged|cannot be read"),
        (["0 0 0", "1 0 0", "2 0 0"], ["3 0 1 2"], "no area"),
    ],
)
def test_unusable_surface(
    tmp_path: Path, vertices: list[str], faces: list[str], message: str
) -> None:
    path = write_ply(tmp_path / "bad.ply", vertices, faces)
    with pytest.raises(InputError, match=message) as caught:
        load_mesh(path)
    assert "bad.ply" in str(caught.value)


def test_missing_mesh_names_the_nearest(tmp_path: Path) -> None:
    write_ply(tmp_path / "pallet.ply", ["0 0 0", "1 0 0", "0 1 0"], ["3 0 1 2"])
    with pytest.raises(InputError, match=r"'palet.ply'.*did you mean 'pallet.ply'"):
        load_mesh(tmp_path / "palet.ply")
    with pytest.raises(InputError, match=r"no mesh 'a\.obj'"):
        load_mesh(tmp_path / "a.obj")


def test_a_folder_is_no_mesh(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"mesh '{tmp_path.name}' is a folder"):
        load_mesh(tmp_path)


@pytest.mark.parametrize("name", ["garbage.ply", "garbage.obj", "garbage.stl", "empty.ply"])
def test_garbage_is_no_mesh(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"" if name.startswith("empty") else bytes(range(256)) * 8)
    with pytest.raises(InputError, match=name):
        load_mesh(path)


@pytest.mark.parametrize("face", ["0 1 2", "1 2 0", "1/1 0/2 2/3", "1//1 2//1 00//1"])
def test_an_obj_file_has_no_vertex_0(tmp_path: Path, face: str) -> None:
    path = tmp_path / "zero.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 10 10 10\nf 1 2 3\nf {face}\n")
    with pytest.raises(InputError, match=r"zero\.obj': line 6: a face of vertex 0"):
        load_mesh(path)


def test_zeros_elsewhere_in_an_obj_file_are_fine(tmp_path: Path) -> None:
    path = tmp_path / "fine.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n# f 0 1 2\n" + "v 0 0 1\n" * 7 + "f 10 2 3\n")
    assert len(load_mesh(path).faces) == 1


def test_truncated_mesh(tmp_path: Path) -> None:
    whole = (scenes_folder() / "meshes" / "pallet.ply").read_bytes()
    path = tmp_path / "half.ply"
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"half\.ply"):
        load_mesh(path)


@pytest.mark.parametrize("suffix", ["dae", "glb", "gltf"])
def test_files_with_units_and_axes_of_their_own_are_for_the_import(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"hangar.{suffix}"
    path.write_text("whatever")
    with pytest.raises(InputError, match=rf"'hangar.{suffix}'.*spisim scenes import .*{path.name}"):
        load_mesh(path)


@pytest.mark.parametrize("name", ["mesh.docx", "mesh.zip", "mesh.zae", "mesh"])
def test_unknown_format(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text("no mesh")
    with pytest.raises(InputError, match=r"unknown format.*ply"):
        load_mesh(path)
