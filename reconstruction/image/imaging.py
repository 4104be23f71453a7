"""Image methods compiled for a pattern plan, for whichever of its readings are usable."""

from collections import OrderedDict
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..operators import (
    PatternPlan,
    SpoiltReadings,
    Throughput,
    decoder_for,
    drift_of,
    redundant_combinations,
)
from .coefficients import CoefficientDecoder
from .method import CarryingMethod, ImageMethod, ImageSolver
from .methods import image_method
from .prior import Prior

MAX_KEPT = 4
"""Sets of usable readings of each plan for which what was compiled is kept, on average."""


class Imaging:
    """Everything that frames share in which the same readings are usable; made once for each.

    ``plans`` are those of successive frames, over and over. Methods that carry something from frame
    to frame begin here.
    """

    def __init__(self, *plans: PatternPlan) -> None:
        self._plans = plans
        self._kept: OrderedDict[tuple[int, bytes], UsableReadings] = OrderedDict()
        self._begun: dict[str, ImageMethod] = {}

    def of(self, usable: NDArray[np.bool_], frame: int = 0) -> "UsableReadings":
        """What is compiled for these ``usable`` (M,) readings of a frame.

        Raises InputError where the plan does not tell the background.
        """
        turn = frame % len(self._plans)
        key = turn, np.packbits(usable).tobytes()
        if key not in self._kept:
            self._kept[key] = UsableReadings(self._plans[turn], usable, self._method)
        self._kept.move_to_end(key)
        if len(self._kept) > MAX_KEPT * len(self._plans):
            self._kept.popitem(last=False)
        return self._kept[key]

    def _method(self, name: str) -> ImageMethod:
        """A method by its name, for this recording alone where it carries something."""
        if name not in self._begun:
            method = image_method(name)
            if isinstance(method, CarryingMethod):
                method = method.begin([decoder_for(plan).operator for plan in self._plans])
            self._begun[name] = method
        return self._begun[name]


class UsableReadings:
    """Decoding of some of a plan's readings, and solvers of its coefficients by method."""

    def __init__(
        self,
        plan: PatternPlan,
        usable: NDArray[np.bool_],
        method: Callable[[str], ImageMethod],
    ) -> None:
        self._plan, self._usable, self._method = plan, usable, method
        self.decoder = decoder_for(plan, usable)
        self._solvers: dict[str, ImageSolver] = {}

    @cached_property
    def spoilt(self) -> SpoiltReadings:
        """Which of the usable readings cannot be right."""
        return SpoiltReadings(self._plan, self._usable, self._throughput)

    @cached_property
    def _throughput(self) -> Throughput:
        return Throughput(self._plan, self._usable)

    @cached_property
    def decode(self) -> CoefficientDecoder:
        """From readings to coefficients."""
        return CoefficientDecoder(
            self.decoder,
            lambda: Prior(self.decoder.operator),
            redundant_combinations(self._plan, self._usable),
            self._throughput,
            drift_of(self._plan, self._usable),
        )

    def solver(self, method: str) -> ImageSolver:
        """From coefficients to an image by a method; InputError where it cannot be used."""
        if method not in self._solvers:
            self._solvers[method] = self._method(method).compile(self.decoder.operator)
        return self._solvers[method]
