"""Which of a file's variables is wanted."""

from collections.abc import Mapping
from typing import TypeVar

from ...base.errors import InputError, nearest

Variable = TypeVar("Variable")


def pick(variables: Mapping[str, Variable], name: str | None) -> Variable:
    """The one of a name, or the only one; InputError if there is none or several."""
    names = list(variables)
    if name is None:
        if len(names) != 1:
            raise InputError(f"name one of its variables: {', '.join(names)}")
        return variables[names[0]]
    if name not in variables:
        raise InputError(f"has no variable {name!r}: {nearest(name, names)}")
    return variables[name]
