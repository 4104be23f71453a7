"""Hundreds of bad inputs: each ends in plain words and status 2, and changes no file.

`badinputs` tells how to read the tables. Slow: all rows; fast: one of eight.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from badinputs import Row, complaint, rows
from desk import lay_out
from reconstruction import Capture

ROWS = rows()
TABLES = sorted({row.table for row in ROWS})
ONE_OF = 8


@pytest.fixture(scope="module")
def desk(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder in which the commands are run."""
    folder = tmp_path_factory.mktemp("desk")
    lay_out(folder, capture)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder


def _refused(of: Iterable[Row], desk: Path) -> None:
    wrong = [
        f"{row}\n    {reported}" for row in of if (reported := complaint(row, desk)) is not None
    ]
    assert not wrong, "\n".join([f"{len(wrong)} are not refused as they should be", *wrong])


def test_there_are_hundreds_and_no_two_alike() -> None:
    assert len({row.line for row in ROWS}) == len(ROWS) >= 700
    assert all(row.words for row in ROWS)


@pytest.mark.parametrize("table", TABLES)
def test_bad_inputs_are_refused(table: str, desk: Path) -> None:
    _refused((row for row in ROWS[::ONE_OF] if row.table == table), desk)


@pytest.mark.slow
@pytest.mark.parametrize("table", TABLES)
def test_all_bad_inputs_are_refused(table: str, desk: Path) -> None:
    _refused((row for row in ROWS if row.table == table), desk)
