"""Runs of a small plan with stand-ins for the making of samples, shared by the tests."""

import sqlite3
from contextlib import closing
from pathlib import Path

from makers import Fake, InThisProcess
from spisim.dataset.planned import PlannedSet, load_plan
from spisim.dataset.runner import State, run_dataset

PLAN = """
name: some
samples: 5
scenes: [{family: targets}]
vary: {scene.fog.visibility_m: {uniform: [20.0, 90.0]}}
"""


def write_plan(folder: Path, text: str) -> PlannedSet:
    path = folder / "plan.yaml"
    path.write_text(text)
    return load_plan(path)


class Run:
    """One run with stand-ins, and all that it said."""

    def __init__(
        self,
        planned: PlannedSet,
        folder: Path,
        bad: dict[int, str] | None = None,
        **options: object,
    ) -> None:
        self.executor = InThisProcess(Fake(folder, bad or {}))
        self.said: list[str] = []
        self.states: list[State] = []
        self.state = run_dataset(
            planned,
            folder,
            self.executor,
            say=self.said.append,
            progress=self.states.append,
            **options,  # type: ignore[arg-type]
        )


def rows(folder: Path, columns: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(folder / "manifest.sqlite")) as connection:
        return connection.execute(f'SELECT {columns} FROM samples ORDER BY "index"').fetchall()
