"""Parameters of a fit by name: what they change in a twin, and between which bounds."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from reconstruction.base.arrays import Mask
from reconstruction.base.errors import InputError, nearest
from reconstruction.ranging.weather import VISIBILITIES_M
from spisim.instrument import Instrument
from spisim.instrument.parts import Throughput
from spisim_inverse.fit.twin import Twin

VISIBILITY, EXTINCTION = "scene.fog.visibility_m", "scene.fog.extinction_per_m"
MATERIAL = "materials."
THROUGHPUT = "throughput"
MAX_FACTOR = 1e3
"""Bounds of a positive parameter without others: its start over and times this."""
REFLECTANCES = 0.002, 0.999
RANGE_OFFSETS_M = -2.0, 2.0
THROUGHPUTS = 0.1, 10.0
INSTRUMENT: dict[str, tuple[str, float, float]] = {
    "projector.power_w": ("W", 1e-12, 1e6),
    "projector.on_off_contrast": ("1", 1 + 1e-6, 1e12),
    "detector.sensor.dark_current_na": ("nA", 0, 1e9),
    "detector.sensor.dark_count_rate_hz": ("Hz", 0, 1e12),
    "lasers.power_w": ("W", 1e-12, 1e6),
    "zones.power_w": ("W", 1e-12, 1e6),
    "tof.detector.sensor.dark_current_na": ("nA", 0, 1e9),
    "tof.detector.sensor.dark_count_rate_hz": ("Hz", 0, 1e12),
}
"""Fields of an instrument on which its light does not depend: unit, lowest and highest start."""
SCALES: dict[str, tuple[str, float, float]] = {
    "buckets.electrons_per_count": ("electron/count", 1e-9, 1e12),
    "buckets.offset_counts": ("count", -1e12, 1e12),
    "spots.electrons_per_count": ("electron/count", 1e-9, 1e12),
    "spots.offset_counts": ("count", -1e12, 1e12),
}
LIMITS = {name: (low, high) for name, (_, low, high) in (INSTRUMENT | SCALES).items()}


@dataclass(frozen=True)
class Parameter:
    """A free number; positive ones are fitted by their logarithm.

    ``changes_light`` is whether light must be traced anew. ``exposures`` (n,) are those on which it
    acts as the projector's power does on all; None for any other parameter.
    """

    name: str
    unit: str
    start: float
    bounds: tuple[float, float]
    positive: bool
    changes_light: bool
    change: Callable[[Twin, float], Twin]
    exposures: Mask | None = None

    def coordinate(self, value: float) -> float:
        """The number that the fit varies."""
        return float(np.log(value)) if self.positive else value

    def value(self, coordinate: float) -> float:
        """The inverse."""
        return float(np.exp(coordinate)) if self.positive else coordinate

    def slope(self, value: float) -> float:
        """Derivative of the value by the coordinate."""
        return value if self.positive else 1.0

    def applied(self, twin: Twin, value: float) -> Twin:
        """The twin with this value."""
        changed = self.change(twin, value)
        return replace(changed, values=twin.values | {self.name: value})


def parameters(twin: Twin, starts: Mapping[str, float | None]) -> list[Parameter]:
    """Parameters by name, each with its start, by default the twin's own value.

    Raises
    ------
    InputError
        For none, unknown names, starts outside the bounds or missing, and parameters that the scene
        or the instrument does not have.
    """
    if not starts:
        raise InputError(f"nothing is free; allowed: {', '.join(available(twin))}")
    if {VISIBILITY, EXTINCTION} <= set(starts):
        raise InputError(f"{VISIBILITY} and {EXTINCTION} are one parameter: free one of them")
    made: list[Parameter] = []
    for name, start in starts.items():
        made += _parameters(twin, name, start)
    for each in made:
        low, high = LIMITS.get(each.name, each.bounds)
        if not low <= each.start <= high:  # nor nan
            raise InputError(f"--free {each.name}={each.start:g}: must be from {low:g} to {high:g}")
    return made


def available(twin: Twin) -> list[str]:
    """Names of all parameters of a twin."""
    fog = [VISIBILITY, EXTINCTION] if twin.scene.atmosphere.extinction_per_m > 0 else []
    materials = sorted({MATERIAL + each.material.name for each in twin.scene.objects})
    own = [name for name in INSTRUMENT if _field(twin.instrument, name) is not None]
    if twin.instrument.images:
        own += ["projector.on_off_contrast"] if "projector.on_off_contrast" not in own else []
    scales = [name for name in SCALES if getattr(twin, name.partition(".")[0]) is not None]
    ranges = ["spots.range_offset_m"] if twin.instrument.ranges else []
    patterns = [THROUGHPUT] if twin.instrument.images else []
    return [*fog, *materials, *own, *scales, *ranges, *patterns]


def _parameters(twin: Twin, name: str, start: float | None) -> list[Parameter]:
    if name in (VISIBILITY, EXTINCTION) and twin.scene.atmosphere.extinction_per_m == 0:
        raise InputError(
            f"--free {name}: the air of scene {twin.scene.name} is clear: begin with fog, by "
            "--visibility or in its file"
        )
    if name not in available(twin):
        raise InputError(f"--free {name}: {nearest(name, available(twin))}")
    if name in (VISIBILITY, EXTINCTION):
        return [_fog(twin, name, start)]
    if name.startswith(MATERIAL):
        return [_reflectance(twin, name, start)]
    if name == THROUGHPUT:
        return _throughput(twin, start)
    if name == "spots.range_offset_m":
        own = twin.range_offset_m if start is None else start
        return [
            Parameter(
                name, "m", own, RANGE_OFFSETS_M, False, False,
                lambda each, value: replace(each, range_offset_m=value),
            )
        ]  # fmt: skip
    if name in SCALES:
        return [_scale(twin, name, start)]
    return [_of_instrument(twin, name, start)]


def _fog(twin: Twin, name: str, start: float | None) -> Parameter:
    air = twin.scene.atmosphere
    if air.parts or twin.scene.volumes:
        raise InputError(f"{name}: the fog must be alone and everywhere: remove other weather")
    if air.visibility_m is None and name == VISIBILITY:
        raise InputError(f"{name}: the visibility of this fog is unknown; free {EXTINCTION}")
    optical = air.extinction_per_m * (air.visibility_m or 1.0)

    def change(each: Twin, value: float) -> Twin:
        sigma = optical / value if name == VISIBILITY else value
        visibility = None if air.visibility_m is None else optical / sigma
        own = replace(each.scene.atmosphere, extinction_per_m=sigma, visibility_m=visibility)
        return replace(each, scene=replace(each.scene, atmosphere=own))

    if name == VISIBILITY:
        own = air.visibility_m if start is None else start
        assert own is not None
        return Parameter(name, "m", own, VISIBILITIES_M, True, True, change)
    own = air.extinction_per_m if start is None else start
    return Parameter(name, "1/m", own, (1e-6, 10.0), True, True, change)


def _reflectance(twin: Twin, name: str, start: float | None) -> Parameter:
    material = name.removeprefix(MATERIAL)
    own = next(e.material for e in twin.scene.objects if e.material.name == material)

    def change(each: Twin, value: float) -> Twin:
        changed = replace(own, reflectance=value)
        objects = tuple(
            replace(thing, material=changed) if thing.material.name == material else thing
            for thing in each.scene.objects
        )
        return replace(each, scene=replace(each.scene, objects=objects))

    value = own.reflectance if start is None else start
    return Parameter(name, "1", value, REFLECTANCES, True, True, change)


def _scale(twin: Twin, name: str, start: float | None) -> Parameter:
    part, _, field = name.partition(".")
    unit, low, _ = SCALES[name]
    value = float(getattr(getattr(twin, part), field)) if start is None else start

    def change(each: Twin, value: float) -> Twin:
        scale = replace(getattr(each, part), **{field: value})
        return replace(each, **{part: scale})

    bounds = _around(value) if low > 0 else (-np.inf, np.inf)
    return Parameter(name, unit, value, bounds, low > 0, False, change)


def _of_instrument(twin: Twin, name: str, start: float | None) -> Parameter:
    unit, low, _ = INSTRUMENT[name]
    own = _field(twin.instrument, name) if start is None else start
    if own is None:
        raise InputError(f"--free {name}: the instrument does not state it: give a start, {name}=X")
    bounds = _around(float(own)) if low > 0 else (0.0, np.inf)
    bounds = max(bounds[0], low), bounds[1]

    def change(each: Twin, value: float) -> Twin:
        return replace(each, instrument=with_field(each.instrument, name, value))

    return Parameter(name, unit, float(own), bounds, low > 0, False, change)


def _throughput(twin: Twin, start: float | None) -> list[Parameter]:
    """A factor for each pattern in the order of exposure; the instrument keeps their mean at 1."""
    if start is not None:
        raise InputError(f"{THROUGHPUT}: has no single start; those of the instrument are used")
    plans = twin.instrument.pattern_plans
    if len(plans) > 1:
        raise InputError(f"{THROUGHPUT}: the plans of {len(plans)} frames differ; record one plan")
    plan = plans[0]
    own = plan.factors_of(plan.distinct)
    factors = tuple((own / own.mean()).tolist())

    def change(number: int) -> Callable[[Twin, float], Twin]:
        def changed(each: Twin, value: float) -> Twin:
            section = each.instrument.imaging.plan.throughput
            before = factors if section is None or section.factors is None else section.factors
            after = (*before[:number], value, *before[number + 1 :])
            throughput = Throughput(factors=after, stated=True)
            instrument = with_field(each.instrument, "plan.throughput", throughput)
            return replace(each, instrument=instrument)

        return changed

    return [
        Parameter(
            f"{THROUGHPUT}[{row}]", "1", factors[number], THROUGHPUTS, True, False, change(number),
            plan.index == row,
        )
        for number, row in enumerate(plan.distinct.tolist())
    ]  # fmt: skip


def _around(value: float) -> tuple[float, float]:
    return value / MAX_FACTOR, value * MAX_FACTOR


def _field(instrument: Instrument, name: str) -> float | None:
    part: Any = instrument
    for each in name.split("."):
        part = getattr(part, each, None)
    return None if part is None else float(part)


def with_field(instrument: Instrument, name: str, value: object) -> Instrument:
    """The instrument with another value of a field."""
    return _changed(instrument, name.split("."), value)


def _changed(section: Any, path: Sequence[str], value: object) -> Any:
    first, *rest = path
    inner = _changed(getattr(section, first), rest, value) if rest else value
    return section.model_copy(update={first: inner})
