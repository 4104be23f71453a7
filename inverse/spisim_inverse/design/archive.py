"""All evaluations of a search, kept in its folder: a search that runs again replays them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError
from reconstruction.base.files import write_atomically
from reconstruction.base.text import json_line
from spisim_inverse.design.plan import PlannedDesign

FILE = "evaluations.jsonl"


@dataclass(frozen=True)
class Evaluation:
    """An instrument's values and figures; None, and a reason, if there is no such instrument.

    ``weathers`` are the figures by objective and weather.
    """

    values: Mapping[str, Any]
    figures: Mapping[str, float] | None
    weathers: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    reason: str = ""

    @property
    def key(self) -> str:
        """Text that distinguishes instruments."""
        return key_of(self.values)


def key_of(values: Mapping[str, Any]) -> str:
    """Text that distinguishes instruments."""
    return json.dumps(values, sort_keys=True)


class Archive:
    """Evaluations by their values, on disk."""

    def __init__(self, folder: Path, planned: PlannedDesign) -> None:
        """Read what an earlier run left.

        Raises
        ------
        InputError
            If the folder holds evaluations of another plan, or the file is not an archive.
        """
        self.path = folder / FILE
        self._kept: dict[str, Evaluation] = {}
        head = json_line({"design": planned.plan.name, "digest": planned.digest})
        self._head = f"{head}\n".encode()
        content = self.path.read_bytes() if self.path.exists() else b""
        complete, _, begun = content.rpartition(b"\n")
        if not complete and self._head.startswith(begun):  # nothing, or a killed run's beginning
            self.path.unlink(missing_ok=True)
            return
        try:
            first, *rest = map(json.loads, complete.split(b"\n"))
            digest = first["digest"]
            evaluations = [Evaluation(**each) for each in rest]
        except (ValueError, KeyError, TypeError):
            raise InputError(f"{self.path}: not the evaluations of a design; move it") from None
        if digest != planned.digest:
            raise InputError(
                f"{folder} holds a search by another plan or with other files, "
                f"{first.get('design')!r}; use another folder, or restore {planned.path.name}"
            )
        self._kept = {each.key: each for each in evaluations}
        if begun:  # a killed run wrote half a line
            write_atomically(self.path, complete + b"\n")

    def get(self, values: Mapping[str, Any]) -> Evaluation | None:
        """The evaluation of these values, if there is one."""
        return self._kept.get(key_of(values))

    def add(self, evaluation: Evaluation) -> None:
        """Keep an evaluation; the first makes the file."""
        head = b"" if self.path.exists() else self._head
        with self.path.open("ab") as file:
            file.write(head + f"{json_line(vars(evaluation))}\n".encode())
        self._kept[evaluation.key] = evaluation
