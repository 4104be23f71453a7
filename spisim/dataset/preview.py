"""What a plan would make: its samples, checked, and what they would cost."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from reconstruction.base.errors import InputError, naming, nearest
from spisim.base.config import dump_yaml, load_yaml
from spisim.dataset.cost import Cost, GroupCost, Pilot
from spisim.dataset.manifest import read_manifest
from spisim.dataset.planned import PlannedSet, Sample
from spisim.dataset.records import Record
from spisim.dataset.runner import State, run_dataset
from spisim.dataset.sample import Maker, WarmMaker, load
from spisim.dataset.workers import Executor
from spisim.scene.materials import shipped_materials

#: Samples at random that a preview loads beside those that `check` does.
AT_RANDOM = 3
#: How far to look for the first sample of a scene.
FARTHEST = 1000
#: Samples that are made to estimate time and size, unless another number is asked for.
PILOT = 12


@dataclass(frozen=True)
class Preview:
    """Samples that were looked at, and the cost of all by those of a pilot that were made."""

    samples: int
    displayed: Sequence[Sample]
    costs: Sequence[GroupCost]
    cost: Cost
    compiling_s: float  # of the pilot, besides
    bytes_per_sample: float
    failures: Mapping[int, str]  # reasons by index, of the pilot's samples
    workers: int

    @property
    def seconds(self) -> float:
        """Time of the whole on this machine."""
        return self.samples * self.cost.mean_s / self.workers

    @property
    def bytes(self) -> int:
        """Size of the whole."""
        return round(self.samples * self.bytes_per_sample)

    def summary(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "samples": self.samples,
            "first": [_row(sample) for sample in self.displayed],
            "cost": vars(self.cost),
            "compiling_s": self.compiling_s,
            "costs": [cost.summary() for cost in self.costs],
            "failures": self.failures,
            "bytes_per_sample": self.bytes_per_sample,
            "workers": self.workers,
            "seconds": self.seconds,
            "bytes": self.bytes,
        }


def check(planned: PlannedSet, at_random: int = 0) -> None:
    """Load the first sample of every scene and grid value, and some at random.

    Raises InputError, naming plan and sample, where one cannot be loaded, and for materials to be
    replaced that are none.
    """
    used: set[str] = set(shipped_materials().names)
    others = np.random.default_rng(planned.plan.seed).integers(planned.plan.size, size=at_random)
    for index in sorted({*_telling(planned), *map(int, others)}):
        sample = planned.sample(index)
        with naming(f"{planned.path}: sample {index}"), catch_warnings():
            simplefilter("ignore")
            load(sample)
            used |= _own_materials(sample) if planned.plan.materials else set()
    for name in planned.plan.materials:
        if name not in used:
            raise InputError(
                f"{planned.path}: materials: no scene has {name!r}: {nearest(name, used)}"
            )


def _own_materials(sample: Sample) -> set[str]:
    """Materials that its scene uses, had none been put in place of others."""
    fields = load_yaml(sample.scene_text, sample.scene_name)
    del fields["material_swaps"]
    scene, _ = load(replace(sample, scene_text=dump_yaml(fields)))
    return {thing.material.name for thing in scene.objects}


def preview(
    planned: PlannedSet,
    folder: Path,
    executor: Callable[[Maker], Executor],
    workers: int,
    *,
    pilot: int = PILOT,
    rows: int = 10,
    progress: Callable[[State], None] = lambda state: None,
) -> Preview:
    """Check a plan, and make some of its samples in a folder: those that it lacks.

    Raises InputError as `check` and `run_dataset` do, and where all of these samples fail.
    """
    check(planned, AT_RANDOM)
    size = planned.plan.size
    chosen = Pilot.of(planned, pilot)
    run_dataset(
        planned,
        folder,
        executor(WarmMaker(planned, folder)),
        only=chosen.indices,
        progress=progress,
    )
    _, everything = read_manifest(folder)
    records = [record for record in everything if record.index in chosen.indices]
    failures = {record.index: record.error or "" for record in records if not record.done}
    try:
        costs, cost = chosen.costs(records)
    except ValueError:
        index, reason = next(iter(failures.items()))
        raise InputError(
            f"{planned.path}: all {len(failures)} samples that were tried failed; sample {index}: "
            f"{reason}"
        ) from None
    return Preview(
        samples=size,
        displayed=[planned.sample(index) for index in range(min(rows, size))],
        costs=costs,
        cost=cost,
        compiling_s=sum(record.compiling_s for record in records),
        bytes_per_sample=float(np.mean([_bytes(record) for record in records if record.done])),
        failures=failures,
        workers=workers,
    )


def _bytes(record: Record) -> int:
    beside = sum(int(file["bytes"]) for file in record.sidecars.values())
    return (record.bytes or 0) + beside


def _telling(planned: PlannedSet) -> set[int]:
    """Indices at which a scene or a value of a grid comes for the first time."""
    plan = planned.plan
    chosen: dict[Any, int] = {}
    for index in range(min(plan.size, FARTHEST)):
        chosen.setdefault(("scene", planned.source_of(index)), index)
        if len(chosen) == len(plan.scenes):
            break
    step = plan.combinations
    for name, values in plan.axes.items():
        step //= len(values)
        for at in range(len(values)):
            chosen.setdefault((name, at), at * step)
    return {index for index in chosen.values() if index < plan.size}


def _row(sample: Sample) -> Mapping[str, Any]:
    return {"index": sample.index, "scene": sample.scene_name, "parameters": sample.parameters}
