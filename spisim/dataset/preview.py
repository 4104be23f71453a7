"""Preview a plan: check its samples and estimate their cost."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from reconstruction.base.errors import InputError, naming, nearest
from spisim.dataset.cost import Cost, GroupCost, Pilot
from spisim.dataset.manifest import read_manifest
from spisim.dataset.planned import PlannedSet, Sample
from spisim.dataset.records import Record
from spisim.dataset.runner import State, run_dataset
from spisim.dataset.sample import Maker, WarmMaker, load
from spisim.dataset.workers import Executor
from spisim.scene.materials import shipped_materials

#: Random samples that a preview loads in addition to those of `check`.
RANDOM_SAMPLES = 3
#: Samples among which the first one of each scene is searched.
MAX_SEARCHED = 1000
#: Default number of samples to make for an estimate of time and size.
PILOT_SAMPLES = 12


@dataclass(frozen=True)
class Preview:
    """The first samples of a plan, and the cost of all of them as estimated from a pilot run."""

    samples: int
    first: Sequence[Sample]
    costs: Sequence[GroupCost]
    cost: Cost
    compiling_s: float  # of the pilot, not in `cost`
    bytes_per_sample: float
    failures: Mapping[int, str]  # reason by index, in the pilot
    workers: int

    @property
    def seconds(self) -> float:
        """Estimated time of the whole set on this machine."""
        return self.samples * self.cost.mean_s / self.workers

    @property
    def bytes(self) -> int:
        """Estimated size of the whole set."""
        return round(self.samples * self.bytes_per_sample)

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready summary."""
        return {
            "samples": self.samples,
            "first": [_row(sample) for sample in self.first],
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
    """Load the first sample of every scene and grid value, and some random ones.

    Raises InputError, naming plan and sample, if one cannot be loaded, and if a material to be
    replaced is in none of the scenes.
    """
    used: set[str] = set(shipped_materials().names)
    others = np.random.default_rng(planned.plan.seed).integers(planned.plan.size, size=at_random)
    for index in sorted({*_first_of_each(planned), *map(int, others)}):
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
    """Return the materials of the scene before any are replaced."""
    fields = sample.scene_fields | {"material_swaps": {}}
    scene, _ = load(replace(sample, scene_fields=fields))
    return {thing.material.name for thing in scene.objects}


def preview(
    planned: PlannedSet,
    folder: Path,
    executor: Callable[[Maker], Executor],
    workers: int,
    *,
    pilot: int = PILOT_SAMPLES,
    rows: int = 10,
    progress: Callable[[State], None] = lambda state: None,
) -> Preview:
    """Check a plan and make a pilot run of samples in a folder.

    Raises InputError as `check` and `run_dataset` do, and if all samples of the pilot fail.
    """
    check(planned, RANDOM_SAMPLES)
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
            f"{planned.path}: all {len(failures)} pilot samples failed; sample {index}: {reason}"
        ) from None
    return Preview(
        samples=size,
        first=[planned.sample(index) for index in range(min(rows, size))],
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


def _first_of_each(planned: PlannedSet) -> set[int]:
    """Return the indices of the first sample of each scene and of each grid value."""
    plan = planned.plan
    chosen: dict[Any, int] = {}
    for index in range(min(plan.size, MAX_SEARCHED)):
        chosen.setdefault(("scene", planned.source_of(index)), index)
        if len(chosen) == len(plan.scenes):
            break
    step = plan.combinations
    for name, values in plan.axes.items():
        step //= len(values)
        for position in range(len(values)):
            chosen.setdefault((name, position), position * step)
    return {index for index in chosen.values() if index < plan.size}


def _row(sample: Sample) -> Mapping[str, Any]:
    return {"index": sample.index, "scene": sample.scene_name, "parameters": sample.parameters}
