"""One sample of a data set, as it is read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from reconstruction import Capture, read_capture
from reconstruction.base.errors import InputError, naming, nearest
from spisim.dataset.fields import FIELDS, find_field
from spisim.dataset.pack import Pack
from spisim.dataset.parameters import Parameters


@dataclass(frozen=True)
class StoredSample:
    """One sample: its parameters, and its capture, which is read on first use."""

    index: int
    scene_name: str
    parameters: Mapping[str, Any]
    path: Path
    sidecars: tuple[Path, ...]  # OpenEXR and NPZ files, if the plan keeps them
    drawn: Parameters = field(repr=False)  # of all samples of the data set
    pack: Pack | None = field(repr=False, default=None)  # replaces the capture

    @cached_property
    def capture(self) -> Capture:
        """The capture. Raises InputError if it is missing or damaged, and for a pack."""
        if self.pack is not None:
            raise InputError(f"{self.pack.folder}: a pack has no captures; open the data set")
        return read_capture(self.path)

    def array(self, name: str) -> NDArray[Any]:
        """Return an array of the sample.

        Parameters
        ----------
        name
            A field as "depth_m" or "depth_m.anchored", or a numeric parameter.

        Returns
        -------
        ndarray
            A parameter is nan if only other samples have it.

        Raises
        ------
        InputError
            If the capture lacks the array, or no sample has a numeric parameter of this name.
        """
        field = find_field(name)
        if field is None:
            check_names([name], self.drawn, self.path)
            return self.drawn.number(name, self.parameters)
        if self.pack is not None:
            (row,) = self.pack.rows([self.index])
            return self.pack.column(name)[row]
        with naming(self.path):
            values = field.read(self.capture)
            if values is None:
                raise InputError(f"the capture has no {name}: {field.meaning}")
        return values.astype(field.dtype, copy=False)


def check_names(names: Iterable[str], drawn: Parameters, source: Path) -> None:
    """Raise InputError for a name of neither an array nor a numeric parameter."""
    for name in names:
        if find_field(name) is None and name not in drawn.shapes:
            raise InputError(
                f"{source}: no array or numeric parameter {name!r}: "
                f"{nearest(name, [*FIELDS, *drawn.shapes])}"
            )
