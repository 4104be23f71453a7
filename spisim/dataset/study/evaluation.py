"""Metrics of every capture of a study, found once and kept."""

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
from spisim.dataset.study import metrics, profile
from spisim.dataset.study.metrics import Methods
from spisim.dataset.study.profile import Profile, depth_profile
from spisim.dataset.workers import Executor

#: What stations are called where methods are chosen.
_OPTIONS = {"images": "image", "spots": "ranging", "depths": "depth"}


@dataclass(frozen=True)
class Evaluation:
    """Metrics and depth profile of one capture, or why there are none."""

    metrics: Mapping[str, float | None]
    profile: Profile = field(default_factory=dict)
    error: str | None = None


@dataclass(frozen=True)
class Evaluator:
    """Evaluates captures of a data set and keeps what it finds. It can be sent to processes."""

    folder: Path
    files: Mapping[int, tuple[str, str]]  # capture and its SHA-256, by index
    methods: Methods

    def __call__(self, index: int) -> Outcome:
        """Evaluate one capture; one that cannot be reconstructed is kept with the reason."""
        file, sha256 = self.files[index]
        layout = Layout(self.folder)
        try:
            result = evaluation_of(read_capture(layout.own(self.folder / file)), self.methods)
        except InputError as error:
            result = Evaluation({}, error=str(error))
        reported = {"key": key_of(sha256, self.methods), **asdict(result)}
        write_atomically(layout.metrics(index), json.dumps(reported).encode())
        return Outcome(index, "done")


def evaluation_of(capture: Capture, methods: Methods = ()) -> Evaluation:
    """Reconstruct all frames by the usual methods and these, and compare them with the truth.

    Raises InputError where there is no truth, or nothing to reconstruct.
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
    """The data set in a folder, and the metrics of its captures by index.

    `methods` are those to be evaluated besides the usual ones, by station and name. What was found
    before is taken, as long as capture, reconstruction and methods are the same. Whatever
    takes its worker with it is told as an error of that capture, and not kept.
    """
    data = open_dataset(folder)
    result = {record.index: _retained(folder, record, methods) for record in data.records}
    missing = {
        record.index: (str(record.file), str(record.sha256))
        for record in data.records
        if result[record.index] is None
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
    retained = {record.index: _retained(folder, record, methods) for record in data.records}
    evaluations = {index: each for index, each in retained.items() if each is not None}
    return data, evaluations | lost


def key_of(sha256: str, methods: Methods) -> str:
    """What the metrics of a capture depend on: its content, the code that finds them, methods."""
    return hashlib.sha256(f"{sha256} {_code()} {methods}".encode()).hexdigest()


@cache
def _code() -> str:
    """Digest of the reconstruction and the metrics as they stand in their files.

    Of methods of other packages, names and versions count.
    """
    files = sorted(Path(reconstruction.__path__[0]).rglob("*.py"))
    files += [Path(str(module.__file__)) for module in (metrics, profile)]
    others = (
        f"{point.group} {point.name} {point.value} {point.dist and point.dist.version}"
        for group in entry_points().groups
        if group.startswith("reconstruction.")
        for point in entry_points(group=group)
    )
    text = "\n".join(sorted(others)).encode()
    return hashlib.sha256(text + b"".join(file.read_bytes() for file in files)).hexdigest()


def _retained(folder: Path, record: Record, methods: Methods) -> Evaluation | None:
    layout = Layout(folder)
    with suppress(OSError, ValueError, KeyError):
        fields = json.loads(layout.own(layout.metrics(record.index)).read_bytes())
        if fields["key"] == key_of(str(record.sha256), methods):
            return Evaluation(fields["metrics"], fields["profile"], fields["error"])
    return None
