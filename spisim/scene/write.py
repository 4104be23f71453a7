"""Scene files and their meshes, all there or none of it."""

import secrets
import shutil
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import trimesh
import yaml

from reconstruction.errors import InputError
from reconstruction.files import require_file
from spisim.scene.load import load_scene
from spisim.scene.model import Scene
from spisim.scene.warning import SceneWarning


@dataclass(frozen=True)
class Written:
    """The files of a scene, and the scene that they were loaded as to check them."""

    scene_file: Path
    mesh_files: tuple[Path, ...]
    scene: Scene
    warnings: tuple[str, ...]


class _Dumper(yaml.SafeDumper):
    """YAML that shows lists of numbers in one line."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> Any:
        flat = all(isinstance(value, (int, float)) for value in sequence)
        return super().represent_sequence(tag, sequence, flow_style=flat)


def check_free(output: Path, overwrite: bool) -> None:
    """InputError unless a scene file and its folder of meshes can be written."""
    if output.suffix not in (".yaml", ".yml"):
        raise InputError(f"{output}: the name of a scene file should end in .yaml")
    require_file(output)
    for path in (output, mesh_folder(output)):
        if path.is_symlink():
            raise InputError(f"{path} is a symbolic link; the name of a new file is needed")
        if path.exists() and not overwrite:
            raise InputError(f"{path} exists; --overwrite replaces it")
    if mesh_folder(output).exists() and not mesh_folder(output).is_dir():
        raise InputError(f"{mesh_folder(output)} is not a folder")


def mesh_folder(output: Path) -> Path:
    """The folder of the meshes of a scene file."""
    return output.with_name(f"{output.stem}-meshes")


def write_scene(
    output: Path, fields: Mapping[str, Any], meshes: Mapping[str, trimesh.Trimesh], header: str
) -> Written:
    """Write a scene file, load it to see that it is one, then give it its name.

    `fields` name the files of `meshes`, which are written into a folder beside the scene file;
    `header` is a comment. Raises InputError for a scene that does not load; then, and when
    interrupted, nothing is left behind and older files stay.
    """
    folder = mesh_folder(output)
    new_folders = [parent for parent in output.parents if not parent.exists()]
    output.parent.mkdir(parents=True, exist_ok=True)
    stage = output.with_name(f".{output.stem}.{secrets.token_hex(4)}.tmp")
    try:
        (stage / folder.name).mkdir(parents=True)
        for name, mesh in meshes.items():
            mesh.export(stage / folder.name / name, include_attributes=False)
        staged = stage / output.name
        staged.write_text(_text(fields, meshes, folder.name, header), encoding="utf-8")
        scene, odd = _loaded(staged, output)
        _put_in_place(stage, output, folder)
    except BaseException:
        shutil.rmtree(stage, ignore_errors=True)
        for parent in new_folders:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
        raise
    shutil.rmtree(stage, ignore_errors=True)
    return Written(output, tuple(folder / name for name in meshes), scene, odd)


def _text(
    fields: Mapping[str, Any],
    meshes: Mapping[str, trimesh.Trimesh],
    folder: str,
    header: str,
) -> str:
    objects = [
        thing | {"mesh": f"{folder}/{thing['mesh']}"} if thing.get("mesh") in meshes else thing
        for thing in fields["objects"]
    ]
    content = {**fields, "objects": objects}
    return header + yaml.dump(
        content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100
    )


def _put_in_place(stage: Path, output: Path, folder: Path) -> None:
    """Move the staged files to their names; older ones go into the stage, or back on failure."""
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
