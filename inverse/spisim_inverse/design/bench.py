"""Instruments made from a base and chosen values, within the limits of the base.

Light is linear in powers, and frames divide their time: a choice of frequencies, of their times or
of patterns changes the periods and the pattern rate so that a frame takes as long as the base's.
"""

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import BaseModel

from reconstruction.base.errors import InputError, nearest
from spisim.base.config import dump_yaml, load_yaml, parse_model
from spisim.budget.eye_safety import LASER_CLASSES, RISK_GROUPS, array_risk_group, laser_safety
from spisim.dataset.values import set_field
from spisim.instrument import Instrument
from spisim.simulation.light.path_bins import MIN_BIN_WIDTH_M

TIMES, LASER_FRACTION = "tof.times", "laser_fraction"
"""Parameters that no field of an instrument file is."""
ROUNDING = 1e-6
"""Relative tolerance of limits."""


@dataclass(frozen=True)
class Bench:
    """A base, and the instruments that can be made from it."""

    base: Instrument
    max_aperture_mm: float | None = None

    def make(self, values: Mapping[str, Any]) -> Instrument:
        """The base with other values, by parameter.

        Raises
        ------
        InputError
            For values that no instrument can have, and for one beyond the limits of the base.
        """
        chosen = dict(_fields_of(values))
        fields = copy.deepcopy(self._fields)
        for path, value in chosen.items():
            if path not in (TIMES, LASER_FRACTION):
                set_field(fields, path, copy.deepcopy(value))
        self._set_periods(fields, chosen)
        self._set_powers(fields, chosen)
        instrument = self._parsed(fields)
        if instrument.images and any(path.startswith("plan.") for path in chosen):
            instrument = self._parsed(self._with_rate(fields, instrument))
        self.check(instrument)
        return instrument

    def check(self, instrument: Instrument) -> None:
        """Raise InputError, naming limit and value, for an instrument beyond the base's limits."""
        if instrument.ranges:
            instrument.ranging.tof.check_bins(MIN_BIN_WIDTH_M)
        for name, value, limit in self._limits(instrument):
            if value > limit * (1 + ROUNDING):
                raise InputError(f"{name} is {value:.6g}; at most {limit:.6g}, as of the base")
        for name, classes, own, highest in self._classes(instrument):
            if classes.index(own) > classes.index(highest):
                raise InputError(f"{name} is {own}; at most {highest}, as of the base")

    def check_name(self, name: str) -> None:
        """Raise InputError, with the nearest name, unless a parameter is one of the instrument."""
        if name in (TIMES, LASER_FRACTION):
            if name == TIMES and not self._has_frequencies:
                raise InputError(f"{TIMES}: the base has no modulation frequencies")
            if name == LASER_FRACTION and not (self.base.images and self.base.lasers):
                raise InputError(f"{LASER_FRACTION}: the base lacks lasers or an array")
            return
        section: Any = self.base
        for depth, part in enumerate(name.split(".")):
            if not isinstance(section, BaseModel):
                raise InputError(f"{name}: the base has no section before {part!r}")
            allowed = list(type(section).model_fields)
            if part not in allowed:
                allowed += [] if depth else [TIMES, LASER_FRACTION]
                raise InputError(f"{name}: unknown field {part!r}: {nearest(part, allowed)}")
            section = getattr(section, part)

    def is_bundle(self, name: str) -> bool:
        """Whether a parameter is neither a field nor one of those beside fields."""
        return "." not in name and name not in (LASER_FRACTION, *Instrument.model_fields)

    def start(self, name: str) -> Any:
        """Value of a parameter in the base; None for a bundle."""
        if name == LASER_FRACTION:
            return self._laser_w / self._total_w
        if name == TIMES:
            tof: Any = self.base.tof
            times = np.array([tof.light_time_s(each) for each in tof.modulation.frequencies_hz])
            return (times / times.sum()).tolist()
        if self.is_bundle(name):
            return None
        value: Any = self._fields
        for part in name.split("."):
            value = None if value is None else value.get(part)
        return value

    @cached_property
    def _fields(self) -> dict[str, Any]:
        fields: dict[str, Any] = load_yaml(self.base.text, "base")
        return fields

    @property
    def _has_frequencies(self) -> bool:
        return self.base.tof is not None and self.base.tof.method == "cw"

    @property
    def _laser_w(self) -> float:
        return _laser_power_w(self.base)

    @property
    def _total_w(self) -> float:
        return self._laser_w + _array_power_w(self.base)

    def _parsed(self, fields: Mapping[str, Any]) -> Instrument:
        return parse_model(dump_yaml(fields), Instrument, "instrument")

    def _set_periods(self, fields: dict[str, Any], chosen: Mapping[str, Any]) -> None:
        """Divide the base's time among the frequencies, by `TIMES` or as the base does."""
        if not self._has_frequencies or "tof.periods" in chosen:
            return
        if not any(path.startswith(("tof.modulation", TIMES)) for path in chosen):
            return
        modulation = fields["tof"]["modulation"]
        frequencies = np.array(modulation["frequencies_hz"], dtype=np.float64)
        times = np.array(chosen.get(TIMES, self.start(TIMES)), dtype=np.float64)
        if times.shape != frequencies.shape:
            if TIMES in chosen:
                raise InputError(
                    f"{TIMES} has {times.size} numbers for {frequencies.size} frequencies"
                )
            times = np.ones_like(frequencies)
        if not (times >= 0).all() or times.sum() == 0:
            raise InputError(f"{TIMES} should not be negative nor all 0; found {times.tolist()}")
        turns = 4 if modulation.get("taps", {}).get("arrangement") == "in-turn" else 1
        assert self.base.tof is not None
        time_s = self.base.tof.frame_time_s / turns * times / times.sum()
        periods = np.floor(time_s * frequencies * (1 + ROUNDING)).astype(int)
        fields["tof"]["periods"] = np.maximum(periods, 1).tolist()

    def _set_powers(self, fields: dict[str, Any], chosen: Mapping[str, Any]) -> None:
        if LASER_FRACTION not in chosen:
            return
        fraction = float(chosen[LASER_FRACTION])
        if not 0 < fraction < 1:
            raise InputError(f"{LASER_FRACTION} should lie between 0 and 1; found {fraction:g}")
        spots = len(fields["lasers"]["directions_deg"])
        fields["lasers"]["power_w"] = fraction * self._total_w / spots
        fields["projector"]["power_w"] = (1 - fraction) * self._total_w

    def _with_rate(self, fields: dict[str, Any], instrument: Instrument) -> dict[str, Any]:
        """The fields with the pattern rate at which all patterns take the base's frame time."""
        rate_hz = instrument.pattern_plan.exposures / self.base.frame_time_s
        fields = copy.deepcopy(fields)
        longer = self.base.imaging.projector.pattern_rate_hz / rate_hz
        fields["projector"]["pattern_rate_hz"] = rate_hz
        fields["exposure_time_s"] = self.base.imaging.exposure_time_s * longer
        return fields

    def _limits(self, instrument: Instrument) -> Iterator[tuple[str, float, float]]:
        """Names, values and upper limits."""
        powers = [_laser_power_w(each) + _array_power_w(each) for each in (instrument, self.base)]
        yield "the emitted power, W,", powers[0], powers[1]
        yield "the frame time, s,", instrument.frame_time_s, self.base.frame_time_s
        if instrument.ranges and self.base.ranges:
            times = [each.ranging.frame_time_s for each in (instrument, self.base)]
            yield "the time of the ranges, s,", times[0], times[1]
        for name, detector in instrument.detectors.items():
            own = self.base.detectors.get(name)
            limit = self.max_aperture_mm
            if limit is None and own is not None:
                limit = _diameter_mm(own)
            if limit is not None:
                yield f"the lens of {name}, mm,", _diameter_mm(detector), limit

    def _classes(self, instrument: Instrument) -> Iterator[tuple[str, tuple[str, ...], str, str]]:
        """Names, classes in their order, value and upper limit."""
        declared = self.base.eye_safety
        if instrument.ranges and self.base.ranges:
            limit = declared.laser_class or laser_safety(self.base).laser_class
            value = laser_safety(instrument).laser_class
            yield "the laser class", LASER_CLASSES, value, limit
        if instrument.images and self.base.images:
            group = declared.risk_group or array_risk_group(self.base).risk_group
            yield "the risk group", RISK_GROUPS, array_risk_group(instrument).risk_group, group


def _fields_of(values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Fields and their values, with those of bundles."""
    for name, value in values.items():
        if "." in name or name == LASER_FRACTION:
            yield name, value
        elif isinstance(value, Mapping):
            yield from value.items()
        else:
            yield name, value


def _laser_power_w(instrument: Instrument) -> float:
    if not instrument.ranges:
        return 0.0
    lasers, zones = instrument.ranging.lasers, instrument.ranging.zones
    return lasers.power_w * (instrument.ranging.spots if zones is None else 1)


def _array_power_w(instrument: Instrument) -> float:
    return instrument.imaging.projector.power_w if instrument.images else 0.0


def _diameter_mm(detector: Any) -> float:
    return 2e3 * math.sqrt(detector.aperture_area_m2 / math.pi)
