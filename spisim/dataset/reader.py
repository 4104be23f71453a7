"""A data set on disk: its samples, what was drawn for them, and their arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from reconstruction import Capture, read_capture
from reconstruction.base.display import html_summary, picture, text_summary
from reconstruction.base.errors import InputError, naming, nearest
from spisim.dataset.extras import needed
from spisim.dataset.fields import FIELDS, find_field
from spisim.dataset.folder import Layout
from spisim.dataset.manifest import read_manifest
from spisim.dataset.pack import Pack
from spisim.dataset.parameters import Parameters
from spisim.dataset.planned import load_plan
from spisim.dataset.records import Record
from spisim.dataset.rows import CaptureRows, PackedRows
from spisim.dataset.split import Split, part_of

if TYPE_CHECKING:
    import pandas
    import torch.utils.data
    import xarray


#: Samples whose pictures a notebook shows.
DISPLAYED = 3


@dataclass(frozen=True)
class StoredSample:
    """One sample: what was drawn for it, and its capture, which is read on first use."""

    index: int
    scene_name: str
    parameters: Mapping[str, Any]
    path: Path
    sidecars: tuple[Path, ...]  # files of the light itself, where the plan keeps them
    drawn: Parameters = field(repr=False)  # for all samples of the data set
    pack: Pack | None = field(repr=False, default=None)  # which has arrays in place of the capture

    @cached_property
    def capture(self) -> Capture:
        """The capture; InputError, naming the file, if it is missing or damaged, and of a pack."""
        if self.pack is not None:
            raise InputError(
                f"{self.pack.folder}: a pack holds arrays and no captures; open the data set"
            )
        return read_capture(self.path)

    def array(self, name: str) -> NDArray[Any]:
        """Array of a field, as "depth_m" or "depth_m.anchored", or the number of a parameter.

        That is nan where only other samples have the parameter.
        Raises InputError for an array that the capture lacks, and if no sample of the data set has
        a number of this name.
        """
        field = find_field(name)
        if field is None:
            _check_names([name], self.drawn, self.path)
            return self.drawn.number(name, self.parameters)
        if self.pack is not None:
            (row,) = self.pack.rows([self.index])
            return self.pack.column(name)[row]
        with naming(self.path):
            values = field.read(self.capture)
            if values is None:
                raise InputError(f"the capture holds no {name}: {field.meaning}")
        return values.astype(field.dtype, copy=False)


@dataclass(frozen=True)
class DataSet(Sequence[StoredSample]):
    """The finished samples of a data set, or some of them, in order of their index.

    A sample is refused with an InputError where one of its files is, or lies behind, a link.

    `failed` has the records of samples that could not be made, whichever are selected.
    """

    folder: Path
    meta: Mapping[str, str]  # name, plan's digest, when made, by which software
    records: tuple[Record, ...]
    failed: tuple[Record, ...]
    drawn: Parameters = field(repr=False, compare=False)  # for all finished samples
    pack: Pack | None = field(repr=False, compare=False, default=None)

    def __len__(self) -> int:
        return len(self.records)

    def __repr__(self) -> str:
        return text_summary(self._title, self._facts)

    @property
    def _title(self) -> str:
        return f"Data set {self.meta.get('name', '')}"

    @property
    def _facts(self) -> dict[str, Any]:
        scenes = {str(record.scene) for record in self.records}
        return {
            "folder": self.folder,
            "samples": f"{len(self):,} done, {len(self.failed):,} failed",
            "scenes": f"{len(scenes):,} different ones",
            "varied": ", ".join(self.records[0].parameters) if self.records else "",
        }

    def _repr_html_(self) -> str:
        pictures = []
        for sample in self[:DISPLAYED]:
            truth = sample.capture.truth
            if truth is not None:
                pictures.append(picture(truth.image[0], f"sample {sample.index}", "electrons"))
        return html_summary(self._title, self._facts, pictures)

    @overload
    def __getitem__(self, position: int) -> StoredSample: ...
    @overload
    def __getitem__(self, position: slice) -> DataSet: ...
    def __getitem__(self, position: int | slice) -> StoredSample | DataSet:
        if isinstance(position, slice):
            return replace(self, records=self.records[position])
        record, layout = self.records[position], Layout(self.folder)
        return StoredSample(
            record.index,
            str(record.scene),
            record.parameters,
            layout.own(self.folder / str(record.file)),
            tuple(layout.own(self.folder / name) for name in record.sidecars),
            self.drawn,
            self.pack,
        )

    def __iter__(self) -> Iterator[StoredSample]:
        return (self[position] for position in range(len(self)))

    def select(self, indices: Iterable[int]) -> DataSet:
        """Samples of these indices; InputError for one that this set lacks."""
        records = {record.index: record for record in self.records}
        wanted = sorted(set(map(int, indices)))
        lacking = [index for index in wanted if index not in records]
        if lacking:
            raise InputError(f"{self.folder}: no finished sample {lacking[0]} in this set")
        return replace(self, records=tuple(records[index] for index in wanted))

    def where(self, condition: Callable[[Mapping[str, Any]], Any]) -> DataSet:
        """Samples whose parameters fulfil a condition, as in `lambda p: p["scene"] == "forest"`.

        A sample without a parameter that the condition asks for is left out. InputError if no
        sample of the data set has it.
        """
        retained: list[Record] = []
        missing: set[str] = set()
        for record in self.records:
            try:
                if condition(record.parameters):
                    retained.append(record)
            except KeyError as error:
                missing.add(str(error.args[0]))
        for name in missing:
            if name not in self.drawn.names:
                raise InputError(
                    f"{self.folder}: no sample has a parameter {name!r}: "
                    f"{nearest(name, self.parameter_names)}"
                )
        return replace(self, records=tuple(retained))

    @property
    def parameter_names(self) -> list[str]:
        """Names of all parameters, of whichever sample of the data set."""
        return self.drawn.names

    def split(
        self,
        train: float = 0.8,
        validation: float = 0.1,
        test: float = 0.1,
        *,
        seed: int = 0,
        by: str = "scene_name",
    ) -> Split[DataSet]:
        """Parts of about these shares; what is equal in `by` is never in two parts.

        `by` is "scene_name" (one and the same scene) or the name of a parameter, such as "scene"
        (the family). The part follows from seed and name alone: more samples move none. Raises
        InputError for shares that do not sum to one, and where a part would be empty.
        """
        fractions = Split(train, validation, test)
        keys = [self._key(record, by) for record in self.records]
        names = {key: part_of(key, fractions, seed) for key in set(keys)}
        parts = Split(
            *(
                replace(
                    self,
                    records=tuple(
                        record
                        for record, key in zip(self.records, keys, strict=True)
                        if names[key] == part
                    ),
                )
                for part in Split._fields
            )
        )
        for part, fraction, chosen in zip(Split._fields, fractions, parts, strict=True):
            if fraction > 0 and not chosen:
                raise InputError(
                    f"{self.folder}: nothing falls to {part} when {len(names)} different values "
                    f"of {by} are split; take more of them, another seed or {part}=0"
                )
        return parts

    def sequences(self) -> list[DataSet]:
        """The samples of each flight, in order: those of one scene from its poses, one a part.

        What failed, or is not selected, is missing in its part. InputError for a plan without
        `poses`.
        """
        plan = load_plan(Layout(self.folder).plan).plan
        if plan.poses.count == 1:
            raise InputError(f"{self.folder}: its plan has no `poses`, so no sequences")
        flights: dict[tuple[int, int], list[Record]] = {}
        for record in self.records:
            round_, combination = divmod(record.index, plan.combinations)
            flights.setdefault((round_ // plan.poses.count, combination), []).append(record)
        return [replace(self, records=tuple(flight)) for flight in flights.values()]

    def _key(self, record: Record, by: str) -> str:
        if by == "scene_name":
            return str(record.scene)
        if by not in record.parameters:
            raise InputError(
                f"{self.folder}: sample {record.index} has no parameter {by!r} to split by: "
                f"{nearest(by, ['scene_name', *record.parameters])}"
            )
        return repr(record.parameters[by])

    def arrays(self, *names: str) -> dict[str, NDArray[Any]]:
        """Stacked arrays (samples, …) of fields or parameters, read from all captures.

        A parameter is nan in samples that lack it. Raises InputError for names that there are not,
        before anything is read, and where shapes differ.
        """
        self.check_names(names)
        if self.pack is not None:
            return {name: np.array(values) for name, values in self._packed(names).items()}
        rows: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
        for sample in self:
            for name, values in rows.items():
                values.append(sample.array(name))
                if values[-1].shape != values[0].shape:
                    raise InputError(
                        f"{sample.path}: {name} has shape {values[-1].shape}, that of the first "
                        f"sample {values[0].shape}; select samples of equal shape"
                    )
        return {name: np.array(values) for name, values in rows.items()}

    def table(self) -> pandas.DataFrame:
        """The manifest as a table by sample index, one column for every parameter, and warnings.

        InputError without pandas.
        """
        pandas = needed("pandas", "data")
        reported = ("file", "bytes", "seconds", "peak_memory_mb", "attempts", "finished")
        rows = [
            {"scene_name": record.scene}
            | {name: getattr(record, name) for name in reported}
            | dict(record.parameters)
            | {"warnings": " | ".join(record.warnings)}
            for record in self.records
        ]
        index = pandas.Index([record.index for record in self.records], name="index", dtype=int)
        columns = ["scene_name", *reported, *self.parameter_names, "warnings"]
        return pandas.DataFrame(rows, index=index, columns=columns)

    def xarray(self, *names: str) -> xarray.Dataset:
        """Stacked arrays with named axes and units; unless named, all that the first capture holds.

        Numbers and words among the parameters are coordinates of the samples, nan in those that
        lack them. InputError as `arrays`, and without xarray.
        """
        xarray = needed("xarray", "data")
        names = names or self._held()
        variables = {}
        for name, values in self.arrays(*names).items():
            field = find_field(name)
            own_dims = tuple(f"{name}.{axis}" for axis in range(values.ndim - 1))
            dims, reported = (own_dims, {}) if field is None else (field.dims, _reported(field))
            variables[name] = (("sample", *dims), values, reported)
        coordinates: dict[str, Any] = {
            name: ("sample", self._column(name))
            for name in self.drawn.names
            if name not in names and self._is_plain(name)
        }
        coordinates["scene_name"] = ("sample", [record.scene for record in self.records])
        coordinates["sample"] = ("sample", [record.index for record in self.records])
        return xarray.Dataset(variables, coordinates, dict(self.meta))

    def _held(self) -> tuple[str, ...]:
        """Names of the arrays that the first sample holds."""
        if self.pack is not None:
            return tuple(self.pack.columns)
        return tuple(
            name
            for name, field in FIELDS.items()
            if len(self) and field.recorded and field.read(self[0].capture) is not None
        )

    def _is_plain(self, name: str) -> bool:
        values = [record.parameters.get(name) for record in self.drawn.records]
        there = [value for value in values if value is not None]
        return bool(there) and all(isinstance(value, str | int | float) for value in there)

    def _column(self, name: str) -> NDArray[Any]:
        """A parameter of every sample, nan where one lacks it."""
        if name in self.drawn.shapes:
            rows = [self.drawn.number(name, record.parameters) for record in self.records]
            return np.array(rows, dtype=None if rows else float)
        words = [record.parameters.get(name) for record in self.records]
        return np.array([np.nan if word is None else word for word in words], dtype=object)

    def rows(self, *names: str) -> Sequence[dict[str, NDArray[Any]]]:
        """Arrays by name of one sample after the other, and its `index`: read when asked for.

        Names as for `arrays`. Those of a pack are views, which cannot be written into. It can be
        sent to other processes. InputError for names that there are not.
        """
        self.check_names(names)
        if self.pack is None:
            return CaptureRows(self, names)
        rows = self.pack.rows([record.index for record in self.records])
        numbers = {name: self._column(name) for name in names if find_field(name) is None}
        return PackedRows(self.pack, names, rows, numbers)

    def _packed(self, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        assert self.pack is not None
        rows = self.pack.rows([record.index for record in self.records])
        return {
            name: self._column(name) if find_field(name) is None else self.pack.column(name)[rows]
            for name in names
        }

    def check_names(self, names: Iterable[str]) -> None:
        """InputError, telling the nearest, for names of neither arrays nor numbers drawn."""
        _check_names(names, self.drawn, self.folder)
        for name in names:
            if self.pack is not None and find_field(name) is not None:
                self.pack.column(name)

    def torch(self, *names: str) -> torch.utils.data.Dataset[dict[str, torch.Tensor]]:
        """Map-style data set for a DataLoader: tensors by name, and the sample's `index`.

        Names as for `arrays`; numbers become float32. InputError for names that there are not,
        and without torch.
        """
        rows = self.rows(*names)
        tensors: torch.utils.data.Dataset[dict[str, torch.Tensor]] = needed(
            "spisim.dataset.torch", "torch"
        ).Tensors(rows)
        return tensors


def open_dataset(folder: str | Path) -> DataSet:
    """Open a data set, finished or not, or a pack; a run that is under way is not disturbed.

    Raises InputError where there is none, where its manifest or what is packed is damaged, and for
    a pack whose data set has other samples by now.
    """
    folder = Path(folder)
    meta, records = read_manifest(folder)
    done = tuple(record for record in records if record.done)
    failed = tuple(record for record in records if not record.done)
    return DataSet(folder, meta, done, failed, Parameters(done), Pack.of(folder, done))


def _check_names(names: Iterable[str], drawn: Parameters, source: Path) -> None:
    """InputError for a name that stands neither for an array nor for a number drawn."""
    for name in names:
        if find_field(name) is None and name not in drawn.shapes:
            raise InputError(
                f"{source}: no numbers under the name {name!r}: "
                f"{nearest(name, [*FIELDS, *drawn.shapes])}"
            )


def _reported(field: Any) -> dict[str, str]:
    return {"units": field.units, "long_name": field.meaning}
