"""Atomic writing of scene files with their meshes."""

import io
import secrets
import shutil
import warnings
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from reconstruction.base.errors import InputError
from reconstruction.base.files import Output, is_marked, mark, require_outputs
from reconstruction.base.folders import locked_name
from spisim.scene.load import load_scene
from spisim.scene.model import Scene, SceneWarning
from spisim.scene.shapes import texture_coordinates

#: Mark of mesh files.
MESH = "mesh"
#: Fields that name files.
FILES = ("mesh", "density", "picture", "texture", "opacity")


@dataclass(frozen=True)
class Written:
    """The files of a scene, and the scene loaded from them as a check."""

    scene_file: Path
    mesh_files: tuple[Path, ...]
    scene: Scene
    warnings: tuple[str, ...]


class _Dumper(yaml.SafeDumper):
    """YAML with lists of numbers on one line."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> Any:
        flat = all(isinstance(value, (int, float)) for value in sequence)
        return super().represent_sequence(tag, sequence, flow_style=flat)


def check_free(output: Path, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """InputError unless a scene file and its mesh folder can be written without harm to `inputs`.

    Users edit scene files, so existing ones are replaced only on request.
    """
    folder = mesh_folder(output)
    for path in (output, folder):
        if path.is_symlink():
            raise InputError(f"{path} is a symbolic link; a new file name is needed")
    require_outputs([Output(output, "scene file", (".yaml", ".yml"))], inputs, overwrite=True)
    for path in (output, folder):
        if path.exists() and not overwrite:
            raise InputError(f"{path} exists; --overwrite replaces it")
    if folder.exists():
        check_meshes(folder, inputs)


def check_meshes(folder: Path, inputs: Iterable[Path] = ()) -> None:
    """InputError unless a folder holds nothing but meshes written by this package."""
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder")
    for path in folder.iterdir():
        if path.is_symlink() or not path.is_file() or not is_marked(path, MESH):
            raise InputError(f"{path} was not written here: move it, or give another name")
    for path in inputs:
        if path.resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{path} is read by this command; give its output another name")


def mesh_folder(output: Path) -> Path:
    """Mesh folder of a scene file; InputError if the file has no name, or none in UTF-8."""
    if not output.name:
        raise InputError(f"{output} is a folder; a file name is needed")
    try:
        output.name.encode()
    except UnicodeEncodeError:
        raise InputError(f"{output}: its name should be UTF-8, as it is in the file") from None
    return output.with_name(f"{output.stem}-meshes")


def write_scene(
    output: Path,
    fields: Mapping[str, Any],
    meshes: Mapping[str, trimesh.Trimesh],
    header: str,
    arrays: Mapping[str, NDArray[Any]] | None = None,
) -> Written:
    """Write a scene file and a folder of `meshes` and `arrays`, and load it as a check.

    `fields` name those files; `.png` arrays are greyscale of 8 or 16 bits. On failure older files
    stay.
    """
    folder, arrays = mesh_folder(output), arrays or {}
    new_folders = [parent for parent in output.parents if not parent.exists()]
    output.parent.mkdir(parents=True, exist_ok=True)
    stage = output.with_name(f".{output.stem}.{secrets.token_hex(4)}.tmp")
    try:
        with locked_name(output):
            (stage / folder.name).mkdir(parents=True)
            for name, mesh in meshes.items():
                (stage / folder.name / name).write_bytes(_ply(mesh))
            for name, array in arrays.items():
                packed = _png(array) if name.endswith(".png") else _npy(array)
                (stage / folder.name / name).write_bytes(packed)
            staged = stage / output.name
            text = _text(fields, {*meshes, *arrays}, folder.name, header)
            staged.write_text(text, encoding="utf-8")
            scene, odd = _loaded(staged, output)
            _put_in_place(stage, output, folder)
    except BaseException:
        shutil.rmtree(stage, ignore_errors=True)
        for parent in new_folders:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        raise
    shutil.rmtree(stage, ignore_errors=True)
    return Written(output, tuple(folder / name for name in (*meshes, *arrays)), scene, odd)


def _ply(mesh: trimesh.Trimesh) -> bytes:
    """A mesh as PLY file, with texture coordinates and its mark in a comment."""
    has_coordinates = texture_coordinates(mesh) is not None  # attributes to trimesh
    data = mesh.export(file_type="ply", include_attributes=has_coordinates)
    first, form, rest = data.split(b"\n", 2)
    return b"\n".join([first, form, f"comment {mark(MESH)}".encode(), rest])


def _png(grey: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """A picture (h, w) with its mark."""
    marked = PngInfo()
    marked.add_text("Software", mark(MESH))
    data = io.BytesIO()
    Image.fromarray(grey).save(data, "png", pnginfo=marked)
    return data.getvalue()


def _npy(array: NDArray[Any]) -> bytes:
    """An array with its mark after the data, where readers do not look."""
    data = io.BytesIO()
    np.save(data, array)
    return data.getvalue() + mark(MESH).encode()


def _text(fields: Mapping[str, Any], files: Collection[str], folder: str, header: str) -> str:
    def placed(row: Mapping[str, Any]) -> dict[str, Any]:
        return {
            key: f"{folder}/{value}" if key in FILES and value in files else value
            for key, value in row.items()
        }

    content = dict(fields)
    for section in ("objects", "volumes", "lamps"):
        if section in fields:
            content[section] = [placed(row) for row in fields[section]]
    if "materials" in fields:
        content["materials"] = {name: placed(row) for name, row in fields["materials"].items()}
    return header + yaml.dump(
        content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100
    )


def _put_in_place(stage: Path, output: Path, folder: Path) -> None:
    """Move staged files to their names and older ones into the stage; undo it on failure."""
    moved: list[tuple[Path, Path]] = []
    try:
        for path in (folder, output):
            if path.exists():
                moved.append((path, path.rename(stage / f"old-{path.name}")))
        for path in (folder, output):
            moved.append((stage / path.name, (stage / path.name).rename(path)))
    except BaseException:
        for before, now in reversed(moved):
            now.rename(before)
        raise


def _loaded(staged: Path, output: Path) -> tuple[Scene, tuple[str, ...]]:
    try:
        with warnings.catch_warnings(record=True) as odd:
            warnings.simplefilter("always", SceneWarning)
            scene = load_scene(staged)
    except InputError as error:
        raise InputError(str(error).replace(str(staged), str(output))) from None
    return scene, tuple(str(warning.message) for warning in odd)
