"""Export a scene: surfaces with the names of their materials, and daylight."""

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
    scene: Scene,
    output: Path,
    overwrite: bool = False,
    further: Sequence[Element] = (),
    inputs: Sequence[Path] = (),
) -> list[Path]:
    """Write a scene as it is now.

    Parameters
    ----------
    scene
        The scene.
    output
        File to write; its suffix selects the format.
    overwrite
        Whether to replace a file, and a folder of meshes if all in it was written here.
    further
        Further elements of a Gazebo world, such as sensors.
    inputs
        Files that must stay.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        For an unknown suffix, further elements in a format without any, an existing file, or a
        scene of this name that another process is writing.
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
            _write_folder(folder, meshes, inputs)
        write_atomically(output, text)
    return [output, *(folder / name for name in meshes)]


def _write_folder(folder: Path, files: Mapping[str, bytes], inputs: Sequence[Path]) -> None:
    """Write all files under a temporary name, then replace an older folder."""
    if folder.exists():
        check_meshes(folder, inputs)
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
