"""YAML text checked against models."""

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

#: Of a scene, a plan or a table, which people write.
MAX_TEXT_BYTES = 64 * 2**20


def read_text(path: Path, expected: str = "a YAML file in UTF-8") -> str:
    """Text of a UTF-8 file; InputError where it is missing, unreadable, too large or not text.

    Devices and pipes, which may never end, are not read.
    """
    try:
        result = path.stat()
        if not stat.S_ISREG(result.st_mode):
            raise InputError(f"{path}: not a regular file; {expected} is expected")
        size_mb, max_mb = result.st_size / 2**20, MAX_TEXT_BYTES >> 20
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
    """Fields of a YAML file that should be of `model`, unchecked.

    Raises InputError, naming `source`, for YAML that does not parse or is not a mapping.
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
    """Check YAML text against a model.

    Parameters
    ----------
    text: the YAML.
    model: the `Section` that describes the whole file.
    source: what error messages call the file.
    folder: where files that it names are looked for; the working folder where None.

    Raises InputError for YAML that does not parse, is not a mapping, or does not fit the model.
    """
    return check_fields(read_mapping(text, model, source), model, source, folder)


def check_fields(
    data: Mapping[Any, Any],
    model: type[Model],
    source: Path | str,
    folder: Path | None = None,
) -> Model:
    """Check the fields of a file against a model. Raises InputError where they do not fit."""
    try:
        return model.model_validate(data, context=folder)
    except ValidationError as error:
        raise InputError(describe(error, data, source)) from None
    except RecursionError:
        raise InputError(f"{source}: a value of it contains itself") from None


def is_file(path: Path) -> bool:
    """Whether there is a file; False too for names that no file can have."""
    return os.path.isfile(path)  # noqa: PTH113 - pathlib raises for names that are too long


def find_named(
    name: str, folder: Path, kind: str, suffixes: tuple[str, ...] = (".yaml", ".yml")
) -> Path:
    """Path of `name`: a file that the user has, else a shipped one of this name in `folder`.

    Raises InputError, with the nearest shipped name, where there is neither.
    """
    given = Path(name)
    if given.suffix in suffixes:
        return given
    files = {path.stem: path for path in folder.glob(f"*{suffixes[0]}")}
    if name in files:
        return files[name]
    if os.path.isdir(given):  # noqa: PTH112 - as above
        raise InputError(f"{name} is a folder; the name of a file is needed")
    if os.path.exists(given):  # noqa: PTH110
        raise InputError(
            f"{name} is no {kind} file by its name, which should end in {' or '.join(suffixes)}"
        )
    raise InputError(
        f"no {kind} {show(name)}: neither a file nor the name of a shipped {kind}; "
        f"{nearest(name, sorted(files))}"
    )


def shipped(folder: str) -> Path:
    """Folder of files that come along: beside the package in a checkout, else within it.

    InputError if it is not there.
    """
    package = Path(__file__).parents[2]
    for position in (package / "shipped" / folder, package.parent / folder):
        if position.is_dir():
            return position
    raise InputError(f"the shipped {folder} are missing; reinstall spisim")
