"""Reading, checking and finding configuration files."""

import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from reconstruction.base.errors import InputError, nearest
from spisim.base.config.fields import Section
from spisim.base.config.messages import describe, show
from spisim.base.config.yaml import load_yaml

Model = TypeVar("Model", bound=Section)

#: Maximum size of a scene, plan or table.
MAX_TEXT_BYTES = 64 * 2**20


def read_text(path: Path, expected: str = "a YAML file in UTF-8") -> str:
    """Text of a UTF-8 file.

    Parameters
    ----------
    path : Path
        A regular file; devices and pipes, which may never end, are not read.
    expected : str
        What messages call the right kind of file.

    Raises
    ------
    InputError
        If the file is missing, unreadable, too large or not text.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: not a regular file; {expected} is expected")
        size_mb, max_mb = status.st_size / 2**20, MAX_TEXT_BYTES >> 20
        if size_mb > max_mb:
            raise InputError(f"{path}: {size_mb:.0f} MB; at most {max_mb} MB of text are read")
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; {expected} is expected") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def read_mapping(text: str, model: type[Section], source: Path | str) -> dict[Any, Any]:
    """Fields of a YAML file, without checking them against their `model`.

    Raises
    ------
    InputError
        Names `source`, for invalid YAML and for anything but a mapping.
    """
    data = load_yaml(text, source)
    if not isinstance(data, dict):
        fields = ", ".join(model.model_fields)
        raise InputError(
            f"{source}: expected a mapping with the fields {fields}, found {show(data)}"
        )
    return data


def parse_model(
    text: str, model: type[Model], source: Path | str, folder: Path | None = None
) -> Model:
    """Parse YAML text and check it against a model.

    Parameters
    ----------
    text : str
        The YAML.
    model : type of Section
        The section that describes the whole file.
    source : Path or str
        What messages call the file.
    folder : Path, optional
        Folder that file names are relative to; by default the working folder.

    Raises
    ------
    InputError
        For invalid YAML, anything but a mapping, and fields that do not fit the model.
    """
    return check_fields(read_mapping(text, model, source), model, source, folder)


def check_fields(
    data: Mapping[Any, Any], model: type[Model], source: Path | str, folder: Path | None = None
) -> Model:
    """Check the fields of a file against a model, as `parse_model` does."""
    try:
        return model.model_validate(data, context=folder)
    except ValidationError as error:
        raise InputError(describe(error, data, source)) from None
    except RecursionError:
        raise InputError(f"{source}: a value of it contains itself") from None


def is_file(path: Path) -> bool:
    """Whether a file exists; False for names that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 - pathlib raises for names that are too long


def find_named(
    name: str, folder: Path, kind: str, suffixes: tuple[str, ...] = (".yaml", ".yml")
) -> Path:
    """Path of a user's file, or of the shipped file of this name.

    Parameters
    ----------
    name : str
        A path with one of the `suffixes`, or the stem of a file in `folder`.
    folder : Path
        Where the shipped files are.
    kind : str
        What messages call such a file.
    suffixes : tuple of str
        Allowed extensions.

    Raises
    ------
    InputError
        Names the nearest shipped file, if there is neither.
    """
    given = Path(name)
    if given.suffix in suffixes:
        return given
    files = {path.stem: path for path in folder.glob(f"*{suffixes[0]}")}
    if name in files:
        return files[name]
    if os.path.isdir(given):  # noqa: PTH112 - as above
        raise InputError(f"{name} is a folder; a file name is needed")
    if os.path.exists(given):  # noqa: PTH110
        raise InputError(
            f"{name} exists, but the name of the {kind} file should end in {' or '.join(suffixes)}"
        )
    raise InputError(
        f"no {kind} {show(name)}: neither a file nor the name of a shipped {kind}; "
        f"{nearest(name, sorted(files))}"
    )


def shipped(folder: str) -> Path:
    """Folder of shipped files: beside the package in a checkout, in it once installed.

    Raises
    ------
    InputError
        If the folder is missing.
    """
    package = Path(__file__).parents[2]
    for path in (package / "shipped" / folder, package.parent / folder):
        if path.is_dir():
            return path
    raise InputError(f"the shipped {folder} are missing; reinstall spisim")
