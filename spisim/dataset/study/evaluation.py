"""Metrics of every capture of a study, cached in the data set's folder."""

import hashlib
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import reconstruction
from reconstruction import Capture, InputError, Reconstructor, read_capture
from reconstruction.base.files import write_atomically
from spisim.dataset.folder import Layout
from spisim.dataset.reader import DataSet, open_dataset
from spisim.dataset.records import DIED, Outcome, Record
from spisim.dataset.study import metrics
from spisim.dataset.study.metrics import Methods, Profile, depth_profile
from spisim.dataset.workers import Executor

#: Arguments of `Reconstructor` by station.
_OPTIONS = {"images": "image", "spots": "ranging", "depths": "depth"}


@dataclass(frozen=True)
class Evaluation:
    """Metrics and depth profile of one capture, or the reason why there are none."""

    metrics: Mapping[str, float | None]
    profile: Profile = field(default_factory=dict)
    error: str | None = None


@dataclass(frozen=True)
class Evaluator:
    """Evaluates captures of a data set and caches the results. It can be pickled."""

    folder: Path
    files: Mapping[int, tuple[str, str]]  # capture and its SHA-256 by index
    methods: Methods

    def __call__(self, index: int) -> Outcome:
        """Evaluate one capture; store the reason if it cannot be reconstructed."""
        file, sha256 = self.files[index]
        layout = Layout(self.folder)
        try:
            result = evaluation_of(read_capture(layout.own(self.folder / file)), self.methods)
        except InputError as error:
            result = Evaluation({}, error=str(error))
        entry = {"key": key_of(sha256, self.methods), **asdict(result)}
        write_atomically(layout.metrics(index), json.dumps(entry).encode())
        return Outcome(index, "done")


def evaluation_of(capture: Capture, methods: Methods = ()) -> Evaluation:
    """Reconstruct all frames by the default and these methods, and compare them with the truth.

    Raises InputError if there is no truth, or nothing to reconstruct.
    """
    if capture.truth is None:
        raise InputError("the capture holds no truth to compare with")
    names: dict[str, Any] = {option: ["usual"] for option in _OPTIONS.values()}
    for station, name in methods:
        names[_OPTIONS[station]].append(name)
    reconstructor = Reconstructor(capture.setup, **names)
    results = reconstructor.batch(capture.batch(0, capture.frames))
    return Evaluation(metrics.measure(capture, results), depth_profile(results, capture.truth))


def evaluate_all(
    folder: Path,
    executor: Callable[[Evaluator], Executor],
    progress: Callable[[float], None] = lambda fraction: None,
    methods: Methods = (),
) -> tuple[DataSet, dict[int, Evaluation]]:
    """Return the data set in a folder, and the evaluations of its captures by index.

    `methods`, by station and name, are evaluated in addition to the default ones. Cached results
    are used as long as capture, code and methods are the same. A capture that kills its worker
    gives an error, which is not cached.
    """
    data = open_dataset(folder)
    missing = {
        record.index: (str(record.file), str(record.sha256))
        for record in data.records
        if _cached(folder, record, methods) is None
    }
    lost: dict[int, Evaluation] = {}
    if missing:
        with executor(Evaluator(folder, missing, methods)) as running:
            for done, outcome in enumerate(running.run(missing), start=1):
                if not outcome.done:
                    lost[outcome.index] = Evaluation(
                        {}, error=f"evaluation: {outcome.error or DIED}"
                    )
                progress(done / len(missing))
    cached = {record.index: _cached(folder, record, methods) for record in data.records}
    evaluations = {index: each for index, each in cached.items() if each is not None}
    return data, evaluations | lost


def key_of(sha256: str, methods: Methods) -> str:
    """Return the cache key of a capture's metrics, from its content, the code and the methods."""
    return hashlib.sha256(f"{sha256} {_code()} {methods}".encode()).hexdigest()


@cache
def _code() -> str:
    """Return a digest of the code of the reconstruction and the metrics.

    Methods of other packages are represented by name and version.
    """
    files = sorted(Path(reconstruction.__path__[0]).rglob("*.py"))
    files.append(Path(metrics.__file__))
    others = (
        f"{point.group} {point.name} {point.value} {point.dist and point.dist.version}"
        for group in entry_points().groups
        if group.startswith("reconstruction.")
        for point in entry_points(group=group)
    )
    text = "\n".join(sorted(others)).encode()
    return hashlib.sha256(text + b"".join(file.read_bytes() for file in files)).hexdigest()


def _cached(folder: Path, record: Record, methods: Methods) -> Evaluation | None:
    layout = Layout(folder)
    with suppress(OSError, ValueError, KeyError):
        fields = json.loads(layout.own(layout.metrics(record.index)).read_bytes())
        if fields["key"] == key_of(str(record.sha256), methods):
            return Evaluation(fields["metrics"], fields["profile"], fields["error"])
    return None
