"""Files that a command writes beside the one that it was told to."""

from pathlib import Path

from reconstruction.errors import InputError


def beside(output: Path, suffix: str, what: str, own_suffix: str) -> Path:
    """The name of a further file, `what`; InputError, before any work, if not both can be written.

    `own_suffix` is proposed for an output that would have the same name.
    """
    from reconstruction.files import require_file

    require_file(output)
    further = output.with_suffix(suffix)
    if further == output:
        raise InputError(f"{output}: {what} takes that name; call this file {own_suffix}")
    require_file(further)
    return further
