"""Read a data set: samples, their parameters, and their arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.display import html_summary, picture, text_summary
from reconstruction.base.errors import InputError, nearest
from spisim.base.optional import import_optional
from spisim.dataset.fields import FIELDS, find_field
from spisim.dataset.folder import Layout
from spisim.dataset.manifest import read_manifest
from spisim.dataset.pack import Pack
from spisim.dataset.parameters import Parameters, Split, part_of
from spisim.dataset.planned import load_plan
from spisim.dataset.records import Record
from spisim.dataset.rows import CaptureRows, PackedRows
from spisim.dataset.stored_sample import StoredSample, check_names

if TYPE_CHECKING:
    import pandas
    import torch.utils.data
    import xarray


#: Samples whose images a notebook displays.
DISPLAYED = 3


@dataclass(frozen=True)
class DataSet(Sequence[StoredSample]):
    """The finished samples of a data set, or some of them, in order of their index.

    `failed` has the records of all samples that could not be made. Accessing a sample raises
    InputError if the path of one of its files contains a symbolic link.
    """

    folder: Path
    meta: Mapping[str, str]  # name, digest of the plan, creation time, software
    records: tuple[Record, ...]
    failed: tuple[Record, ...]
    drawn: Parameters = field(repr=False, compare=False)  # of all finished samples
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
        """Return the samples with these indices. Raises InputError if one is not in this set."""
        records = {record.index: record for record in self.records}
        wanted = sorted(set(map(int, indices)))
        missing = [index for index in wanted if index not in records]
        if missing:
            raise InputError(f"{self.folder}: no finished sample {missing[0]} in this set")
        return replace(self, records=tuple(records[index] for index in wanted))

    def where(self, condition: Callable[[Mapping[str, Any]], Any]) -> DataSet:
        """Return the samples whose parameters fulfil a condition.

        Parameters
        ----------
        condition
            Called with a sample's parameters, as in `lambda p: p["scene"] == "forest"`. A
            sample that lacks a requested parameter is left out.

        Raises
        ------
        InputError
            If no sample of the data set has a requested parameter.
        """
        selected: list[Record] = []
        missing: set[str] = set()
        for record in self.records:
            try:
                if condition(record.parameters):
                    selected.append(record)
            except KeyError as error:
                missing.add(str(error.args[0]))
        for name in missing:
            if name not in self.drawn.names:
                raise InputError(
                    f"{self.folder}: no sample has a parameter {name!r}:"
                    f"{nearest(name, self.parameter_names)}"
                )
        return replace(self, records=tuple(selected))

    @property
    def parameter_names(self) -> list[str]:
        """Names of all parameters in the data set."""
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
        """Split the data set into training, validation and test parts.

        The part of a sample depends only on the seed and its value of `by`, so that adding samples
        moves none.

        Parameters
        ----------
        train, validation, test
            Approximate fractions, which sum to 1.
        seed
            Seed of the assignment.
        by
            "scene_name", or a parameter such as "scene" (the family). Samples with equal values are
            never in different parts.

        Raises
        ------
        InputError
            If the fractions do not sum to 1, or a part would be empty.
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
                    f"{self.folder}: {part} is empty when {len(names)} different values of {by} "
                    f"are split; use more values, another seed or {part}=0"
                )
        return parts

    def sequences(self) -> list[DataSet]:
        """Return the samples of each flight in order: those of one scene from all its poses.

        A recorded flight is one sample, whose arrays have a row per frame. Failed and unselected
        samples are missing. Raises InputError if the plan has no `poses`.
        """
        plan = load_plan(Layout(self.folder).plan).plan
        if plan.frames == "flight":
            return [replace(self, records=(record,)) for record in self.records]
        if plan.poses.count == 1:
            raise InputError(f"{self.folder}: no sequences, because the plan has no `poses`")
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
        """Stack arrays of all samples.

        Parameters
        ----------
        *names
            Fields or numeric parameters. A parameter is nan in samples that lack it.

        Returns
        -------
        dict of str to ndarray, (samples, …)

        Raises
        ------
        InputError
            If a name is unknown, before anything is read, or if shapes differ.
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
                        f"{sample.path}: {name} has shape {values[-1].shape}, but "
                        f"{values[0].shape} in the first sample; select samples of equal shape"
                    )
        return {name: np.array(values) for name, values in rows.items()}

    def table(self) -> pandas.DataFrame:
        """Return the manifest as a pandas table: a row per sample, a column per parameter.

        Raises InputError without pandas.
        """
        pandas = import_optional("pandas", "data")
        recorded = ("file", "bytes", "seconds", "peak_memory_mb", "attempts", "finished")
        rows = [
            {"scene_name": record.scene}
            | {name: getattr(record, name) for name in recorded}
            | dict(record.parameters)
            | {"warnings": " | ".join(record.warnings)}
            for record in self.records
        ]
        index = pandas.Index([record.index for record in self.records], name="index", dtype=int)
        columns = ["scene_name", *recorded, *self.parameter_names, "warnings"]
        return pandas.DataFrame(rows, index=index, columns=columns)

    def xarray(self, *names: str) -> xarray.Dataset:
        """Return stacked arrays with named axes and units; by default all of the first capture.

        Numeric and text parameters are coordinates of the samples, nan in those that lack them.
        Raises InputError as `arrays`, and without xarray.
        """
        xarray = import_optional("xarray", "data")
        names = names or self._available()
        variables = {}
        for name, values in self.arrays(*names).items():
            field = find_field(name)
            dims = tuple(f"{name}.{axis}" for axis in range(values.ndim - 1))
            attributes = {}
            if field is not None:
                dims, attributes = field.dims, {"units": field.units, "long_name": field.meaning}
            variables[name] = (("sample", *dims), values, attributes)
        coordinates: dict[str, Any] = {
            name: ("sample", self._column(name))
            for name in self.drawn.names
            if name not in names and self._is_plain(name)
        }
        coordinates["scene_name"] = ("sample", [record.scene for record in self.records])
        coordinates["sample"] = ("sample", [record.index for record in self.records])
        return xarray.Dataset(variables, coordinates, dict(self.meta))

    def _available(self) -> tuple[str, ...]:
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
        values = [value for value in values if value is not None]
        return bool(values) and all(isinstance(value, str | int | float) for value in values)

    def _column(self, name: str) -> NDArray[Any]:
        """Return a parameter of every sample; nan in those that lack it."""
        if name in self.drawn.shapes:
            rows = [self.drawn.number(name, record.parameters) for record in self.records]
            return np.array(rows, dtype=None if rows else float)
        words = [record.parameters.get(name) for record in self.records]
        return np.array([np.nan if word is None else word for word in words], dtype=object)

    def rows(self, *names: str) -> Sequence[dict[str, NDArray[Any]]]:
        """Return a sequence of samples, each a dict of arrays and its `index`, read on access.

        Names as for `arrays`. Arrays of a pack are read-only views. The sequence can be pickled.
        Raises InputError for unknown names.
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
        """Raise InputError for names of neither arrays nor numeric parameters."""
        check_names(names, self.drawn, self.folder)
        for name in names:
            if self.pack is not None and find_field(name) is not None:
                self.pack.column(name)

    def torch(self, *names: str) -> torch.utils.data.Dataset[dict[str, torch.Tensor]]:
        """Return a map-style data set for a DataLoader: tensors by name, and the sample's `index`.

        Names as for `arrays`; numbers become float32. Raises InputError for unknown names, and
        without PyTorch.
        """
        rows = self.rows(*names)
        module = import_optional("spisim.dataset.torch", "torch")
        tensors: torch.utils.data.Dataset[dict[str, torch.Tensor]] = module.Tensors(rows)
        return tensors


def open_dataset(folder: str | Path) -> DataSet:
    """Open a data set, finished or not, or a pack. It is safe during a run.

    Parameters
    ----------
    folder
        Folder of the data set or pack.

    Returns
    -------
    DataSet
        All finished samples.

    Raises
    ------
    InputError
        If there is no data set, its manifest or pack is damaged, or a pack is out of date.
    """
    folder = Path(folder)
    meta, records = read_manifest(folder)
    done = tuple(record for record in records if record.done)
    failed = tuple(record for record in records if not record.done)
    return DataSet(folder, meta, done, failed, Parameters(done), Pack.of(folder, done))
