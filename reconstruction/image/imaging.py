"""Image methods compiled for a pattern plan, for whichever of its readings are usable."""

from collections import OrderedDict
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..operators import PatternPlan, decoder_for, redundant_combinations
from .coefficients import CoefficientDecoder
from .dictionaries.dct import DICTIONARY
from .method import ImageSolver
from .methods import image_method
from .prior import Prior

MAX_KEPT = 8
"""Sets of usable readings for which what was compiled is kept."""


class Imaging:
    """Everything that frames share in which the same readings are usable; made once for each."""

    def __init__(self, plan: PatternPlan) -> None:
        self._plan = plan
        self._kept: OrderedDict[bytes, UsableReadings] = OrderedDict()

    def of(self, usable: NDArray[np.bool_]) -> "UsableReadings":
        """What is compiled for these ``usable`` (M,) readings.

        Raises InputError where the plan does not tell the background.
        """
        key = np.packbits(usable).tobytes()
        if key not in self._kept:
            self._kept[key] = UsableReadings(self._plan, usable)
        self._kept.move_to_end(key)
        if len(self._kept) > MAX_KEPT:
            self._kept.popitem(last=False)
        return self._kept[key]


class UsableReadings:
    """Decoding of some of a plan's readings, and solvers of its coefficients by method."""

    def __init__(self, plan: PatternPlan, usable: NDArray[np.bool_]) -> None:
        self._plan, self._usable = plan, usable
        self.decoder = decoder_for(plan, usable)
        self._solvers: dict[str, ImageSolver] = {}

    @cached_property
    def decode(self) -> CoefficientDecoder:
        """From readings to coefficients."""
        return CoefficientDecoder(
            self.decoder,
            lambda: Prior(self.decoder.operator, DICTIONARY),
            redundant_combinations(self._plan, self._usable),
        )

    def solver(self, method: str) -> ImageSolver:
        """From coefficients to an image by a method; InputError where it cannot be used."""
        if method not in self._solvers:
            self._solvers[method] = image_method(method).compile(self.decoder.operator)
        return self._solvers[method]
