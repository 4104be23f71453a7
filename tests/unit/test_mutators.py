"""Faults that tools/mutation.py makes: one at a time, where code is run, and sound Python."""

import ast

import pytest

from mutators import mutants

SOURCE = b'''"""Text with 1 < 2."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    A = 1 + 2

LIMIT: "int | None" = 3  # \xc3\xa9


def area(width: float = 0.5, *, half: bool = True) -> "float | int":
    """Say 2 * 2."""
    if width is None or not half:
        return -width
    total = (
        width
        ** 2
    )
    total += 1
    match total:
        case 4:
            total = 0.0
    return total if half else f"{width * 100:.1f}"
'''


def faults(source: bytes = SOURCE) -> list[tuple[int, str]]:
    result = sorted(mutants("a.py", source), key=lambda each: each.start)
    return [(each.line, each.change) for each in result]


def test_every_operator_number_and_condition_that_runs_is_changed_once() -> None:
    assert faults() == [
        (8, "3 → 4"),
        (11, "0.5 → 0.75"),
        (11, "True → False"),
        (13, "is → is not"),
        (13, "or → and"),
        (13, "not → "),
        (14, "- → "),
        (17, "** → *"),
        (17, "2 → 3"),
        (19, "+ → -"),
        (19, "1 → 2"),
        (22, "0.0 → 1.0"),
        (23, "half → (not half)"),
        (23, "* → /"),
        (23, "100 → 101"),
    ]


def test_each_is_python_that_differs() -> None:
    for each in mutants("a.py", SOURCE):
        changed = ast.parse(each.applied(SOURCE))
        assert ast.dump(changed) != ast.dump(ast.parse(SOURCE))


@pytest.mark.parametrize(
    ("change", "lines", "function"),
    [
        ("3 → 4", None, None),  # on import
        ("0.5 → 0.75", None, (11, 23)),  # on import, to be felt where the function is called
        ("or → and", (13, 13), None),
        ("** → *", (15, 18), None),
        ("0.0 → 1.0", (22, 22), None),
    ],
)
def test_it_is_known_which_lines_run_it(change, lines, function) -> None:
    result = next(each for each in mutants("a.py", SOURCE) if each.change == change)
    assert (result.lines, result.function) == (lines, function)
    assert result.is_number == change[0].isdigit()
