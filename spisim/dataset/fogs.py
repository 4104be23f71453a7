"""Samples that differ only in the visibility of their fog share the light of a few passes.

Which samples these are, and the light of each, follows from the plan alone, so that a sample is the
same wherever and after whichever others it is made. A process keeps the light of the last series.
"""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

from reconstruction.base.errors import InputError
from spisim.dataset.plan import is_field
from spisim.dataset.planned import PlannedSet, Sample
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light import Transport
from spisim.simulation.light.fogs import trace_fogs
from spisim.simulation.light.other_fog import require_fog_alone

#: Indices of samples, ascending.
Indices = tuple[int, ...]
Load = Callable[[Sample], tuple[Scene, Instrument]]


@dataclass(frozen=True)
class FogSeries:
    """Series of samples of a plan that differ only in `scene.fog.visibility_m`."""

    planned: PlannedSet

    def of(self, index: int) -> Indices:
        """The series of a sample: itself alone if no other differs in the visibility alone.

        Plans that order numbers of paths, flights and surrogates have no series.
        """
        if not self._axes:
            return (index,)
        if index not in self._known:
            for series in self._around(index):
                self._known.update(dict.fromkeys(series, series))
        return self._known.setdefault(index, (index,))

    def first_of(self, index: int) -> int:
        """The first sample of its series."""
        return self.of(index)[0]

    def world_of(self, index: int) -> int:
        """A number shared by samples whose light, or else whose surfaces, are worth reusing."""
        series = self.of(index)
        return series[0] if len(series) > 1 else self.planned.world_of(index)

    @cached_property
    def _known(self) -> dict[int, Indices]:
        return {}

    @cached_property
    def _axes(self) -> list[range]:
        """Offsets of the indices along each grid that sets something of the fog."""
        plan = self.planned.plan
        if plan.light != "traced" or plan.spp is not None or plan.frames == "flight":
            return []
        step, axes = plan.combinations, []
        for name, values in plan.axes.items():
            step //= len(values)
            fields = [name] if is_field(name) else [f for v in values for f in _fields(v)]
            if any(f"{field}.".startswith("scene.fog.") for field in fields):
                axes.append(range(0, step * len(values), step))
        return axes

    def _around(self, index: int) -> Iterator[Indices]:
        """All series among the samples that differ from one along these grids."""
        first = index
        for axis in self._axes:
            first -= (index // axis.step) % len(axis) * axis.step
        alike: dict[str, list[int]] = {}
        for offsets in product(*self._axes):
            number = first + sum(offsets)
            with suppress(InputError):
                sample = self.planned.sample(number)
                if (key := _but_visibility(sample)) is not None:
                    alike.setdefault(key, []).append(number)
        yield from (tuple(sorted(series)) for series in alike.values())


def _fields(value: Any) -> list[str]:
    return list(value) if isinstance(value, Mapping) else []


def _but_visibility(sample: Sample) -> str | None:
    """Everything that light depends on except the visibility of the fog; None without one."""
    fog = sample.scene_fields.get("fog")
    if not isinstance(fog, Mapping) or "visibility_m" not in fog:
        return None
    droplets = {name: value for name, value in fog.items() if name != "visibility_m"}
    scene = {**sample.scene_fields, "fog": droplets}
    folders = (sample.scene_folder, sample.instrument_folder)
    rest = (scene, sample.instrument_fields, folders, sample.wavelength_nm, sample.view)
    return json.dumps(rest, sort_keys=True, default=repr)


@dataclass(frozen=True)
class SeriesLight:
    """Light of a series by sample; those that must be traced alone are not in it."""

    light: Mapping[int, Transport]
    visibility_m: Mapping[int, float]  # of the fog whose paths carry it
    warnings: tuple[warnings.WarningMessage, ...]
    seconds: float
    is_new: bool = True  # traced by this call


_last: dict[tuple[str, Indices], SeriesLight] = {}


def light_of(planned: PlannedSet, series: Indices, load: Load) -> SeriesLight:
    """The light of a series, traced unless it was the last one asked for in this process.

    Empty unless fog is alone in the scene, where nothing moves or is steered.
    """
    key = (planned.digest, series)
    if key in _last:
        return replace(_last[key], is_new=False)
    forget()
    _last[key] = _traced(planned, series, load)
    return _last[key]


def forget() -> None:
    """Forget the light of the last series."""
    _last.clear()


def _traced(planned: PlannedSet, series: Indices, load: Load) -> SeriesLight:
    began = time.perf_counter()
    scenes: dict[int, Scene] = {}
    instrument: Instrument | None = None
    with warnings.catch_warnings():  # each sample has its own again
        warnings.simplefilter("ignore")
        for index in series:
            with suppress(InputError):
                scene, instrument = load(planned.sample(index))
                require_fog_alone(scene)
                if not scene.moves and not _is_steered(instrument):
                    scenes[index] = scene
    lights: tuple[Transport, ...] = ()
    with warnings.catch_warnings(record=True) as caught, suppress(InputError):
        warnings.simplefilter("always")
        if len(scenes) > 1 and instrument is not None:
            lights = trace_fogs(
                tuple(scenes.values()),
                instrument,
                seeds=[planned.sample(index).seed for index in scenes],
                **planned.plan.sampling_budget,
            )
    light = dict(zip(scenes, lights, strict=False))  # none after an error
    visibility_m = {
        index: float(scenes[index].atmosphere.visibility_m or 0)
        * (1 if each.reweighted is None else each.reweighted.ratio)
        for index, each in light.items()
    }
    return SeriesLight(light, visibility_m, tuple(caught), time.perf_counter() - began)


def _is_steered(instrument: Instrument) -> bool:
    return instrument.lasers is not None and instrument.lasers.steering is not None
