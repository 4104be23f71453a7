"""Instruments measured on the scenes of one part of a plan."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.base.errors import InputError
from spisim.base.config.distributions import stream
from spisim.instrument import Instrument
from spisim_inverse.design.archive import Evaluation
from spisim_inverse.design.cases import Part, make_cases
from spisim_inverse.design.light import TracedLight
from spisim_inverse.design.objectives import OBJECTIVES, figure, over_weathers
from spisim_inverse.design.plan import PlannedDesign
from spisim_inverse.design.sampling import BOUNDS, RANGES, Sample, has_bounds, sample

LIGHT = "light"
"""Folder of the light, in that of the design."""


class Measuring:
    """Figures of instruments on the scenes of a part, whose light is traced when needed."""

    def __init__(self, planned: PlannedDesign, folder: Path, part: Part) -> None:
        """Make the scenes; InputError as `make_cases`."""
        plan = planned.plan
        self._plan, self._part = plan, part
        self._max_range_m = plan.max_range_m or _unambiguous_range_m(planned.instrument)
        seed = int(stream(plan.seed, part, "light").integers(2**31))
        self._light = TracedLight(make_cases(planned, part), folder / LIGHT, plan.spp, seed)
        self._wanted = {OBJECTIVES[name].samples for name in plan.objectives}

    def samples(
        self, instrument: Instrument, noise: str, draws: int, progress: Callable[[float], None]
    ) -> list[Sample]:
        """Samples of all cases; instruments have equal noise if it has the same name.

        In the judgement, errors of ranges come with their bounds, where there are any.
        """
        lit = self._light.of(instrument, progress)
        wanted = set(self._wanted)
        if self._part == "judgement" and RANGES in wanted:
            wanted |= (
                {BOUNDS} if has_bounds(instrument, (each.case.scene for each in lit)) else set()
            )
        return sample(
            instrument,
            lit,
            wanted,
            max_range_m=self._max_range_m,
            draws=draws,
            seed=int(stream(self._plan.seed, self._part, noise).integers(2**31)),
        )

    def evaluation(self, values: Mapping[str, Any], samples: Sequence[Sample]) -> Evaluation:
        """Figures of samples, which are all defined; InputError if one is not."""
        weathers = {name: over_weathers(name, samples) for name in self._plan.objectives}
        for name, each in weathers.items():
            for weather, value in each.items():
                if not value > 0 or not np.isfinite(value):
                    raise InputError(
                        f"{name} is {value:g} in {weather}: no spot within "
                        f"{self._max_range_m:g} m, or no light"
                    )
        return Evaluation(
            dict(values), {name: figure(each) for name, each in weathers.items()}, weathers
        )


def _unambiguous_range_m(base: Instrument) -> float:
    return base.ranging.tof.unambiguous_range_m if base.ranges else np.inf
