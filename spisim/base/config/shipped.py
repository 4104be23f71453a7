"""Files that come with the package: scenes, studies, examples."""

from pathlib import Path

from reconstruction.base.errors import InputError


def shipped(folder: str) -> Path:
    """Folder of files that come along: beside the package in a checkout, else within it.

    InputError if it is not there.
    """
    package = Path(__file__).parents[2]
    for position in (package / "shipped" / folder, package.parent / folder):
        if position.is_dir():
            return position
    raise InputError(f"the shipped {folder} are missing; reinstall spisim")
