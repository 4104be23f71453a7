"""What a plan would make: its samples, checked, and what they would cost."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from reconstruction.base.errors import InputError, naming, nearest
from spisim.base.config import dump_yaml, load_yaml
from spisim.dataset.planned import PlannedSet, Sample
from spisim.dataset.sample import Maker, load
from spisim.scene.materials import shipped_materials

#: Samples at random that a preview loads beside those that `check` does.
AT_RANDOM = 3
#: How far to look for the first sample of a scene.
FARTHEST = 1000
#: Samples that are made to tell time and size.
TIMED = 2


@dataclass(frozen=True)
class Preview:
    """Samples that were looked at, and the cost of all."""

    samples: int
    shown: Sequence[Sample]
    seconds_per_sample: float
    bytes_per_sample: int
    workers: int

    @property
    def seconds(self) -> float:
        """Time of the whole on this machine."""
        return self.samples * self.seconds_per_sample / self.workers

    @property
    def bytes(self) -> int:
        """Size of the whole."""
        return self.samples * self.bytes_per_sample

    def summary(self) -> dict[str, Any]:
        """JSON-ready."""
        return {
            "samples": self.samples,
            "first": [_row(sample) for sample in self.shown],
            "seconds_per_sample": self.seconds_per_sample,
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


def preview(planned: PlannedSet, workers: int, rows: int = 10) -> Preview:
    """Check a plan and make a few samples in a folder that is removed again.

    Raises InputError as `check` does, and where one of these samples fails.
    """
    check(planned, AT_RANDOM)
    size = planned.plan.size
    with tempfile.TemporaryDirectory() as folder:
        make = Maker(planned, Path(folder))
        make(0)  # the first also compiles what the others use again
        made = [make(int(index)) for index in np.linspace(0, size - 1, min(TIMED, size))]
        for outcome in made:
            if not outcome.done:
                raise InputError(f"{planned.path}: sample {outcome.index}: {outcome.error}")
        sizes = [file.stat().st_size for file in Path(folder).rglob("*") if file.is_file()]
        different = len({0, *(outcome.index for outcome in made)})
    return Preview(
        samples=size,
        shown=[planned.sample(index) for index in range(min(rows, size))],
        seconds_per_sample=float(np.mean([outcome.seconds or 0 for outcome in made])),
        bytes_per_sample=round(sum(sizes) / different),
        workers=workers,
    )


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
