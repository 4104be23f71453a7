"""From a scene to a foreign file: surfaces with the names of their materials, and daylight."""

import secrets
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

from reconstruction.base.errors import InputError, nearest
from reconstruction.base.files import write_atomically
from reconstruction.base.folders import locked_name
from spisim.scene.model import Scene
from spisim.scene.write import check_meshes, mesh_folder
from spisim_formats.format import writers


def export_scene(
    scene: Scene, output: Path, overwrite: bool = False, further: Sequence[Element] = ()
) -> list[Path]:
    """Write a scene as it stands now; the files written.

    A world of Gazebo has `further` elements too, such as sensors. Raises InputError for a suffix of
    no format that is written, or one without such elements, where another process writes a scene of
    this name, and where a file is there unless it may be replaced; a folder of meshes is only if
    all in it was written here.
    """
    folder, suffix = mesh_folder(output), output.suffix.lower()
    given = writers()
    if suffix not in given:
        raise InputError(f"{output}: unknown format {suffix!r}: {nearest(suffix, given)}")
    if further and suffix != ".sdf":
        raise InputError(f"{output}: {suffix} has no sensors; those go into worlds of Gazebo, .sdf")
    text, meshes = given[suffix](scene, folder.name, further)
    for path in (output, *([folder] if meshes else [])):
        if path.exists() and not overwrite:
            raise InputError(f"{path} exists; --overwrite replaces it")
    output.parent.mkdir(parents=True, exist_ok=True)
    with locked_name(output):
        if meshes:
            _write_folder(folder, meshes)
        write_atomically(output, text)
    return [output, *(folder / name for name in meshes)]


def _write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """All files under a temporary name, then in place of an older folder."""
    if folder.exists():
        check_meshes(folder)
    stage = folder.with_name(f".{folder.name}.{secrets.token_hex(4)}.tmp")
    try:
        stage.mkdir()
        for name, data in files.items():
            (stage / name).write_bytes(data)
        if folder.exists():
            shutil.rmtree(folder)
        stage.rename(folder)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
