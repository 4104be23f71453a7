"""Image methods compiled for a pattern plan, for whichever of its readings are usable."""

from collections.abc import Callable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..operators import (
    OutlierDetector,
    PatternPlan,
    Throughput,
    decoder_for,
    drift_of,
    redundant_combinations,
)
from .coefficients import CoefficientDecoder, Coefficients
from .method import CarryingMethod, ImageMethod, ImageSolver
from .methods import image_method
from .prior import Prior


class Imaging:
    """Everything that frames share, made once for each plan.

    ``plans`` are those of successive frames, over and over. Readings that are not usable have
    infinite noise, which takes no compiling. Only where patterns are not orthogonal, and so every
    coefficient rests on every reading, the usable ones are compiled for, and kept as long as it is
    the same ones. Methods that carry something from frame to frame begin here. ``own`` are methods
    that are not registered, by name.
    """

    def __init__(
        self, *plans: PatternPlan, own: Mapping[str, ImageMethod] = MappingProxyType({})
    ) -> None:
        self._plans = plans
        self._own = own
        self._whole: dict[int, CompiledPlan] = {}
        self._fewer: tuple[tuple[int, bytes], CompiledPlan] | None = None
        self._begun: dict[str, ImageMethod] = {}

    def of(self, usable: Mask, frame: int = 0) -> "UsableReadings":
        """What is compiled for a frame of which these readings (M,) are ``usable``.

        Raises InputError where the plan does not tell the background.
        """
        turn = frame % len(self._plans)
        plan = self._plans[turn]
        if not plan.patterns.orthogonal and not usable.all():
            key = turn, np.packbits(usable).tobytes()
            if self._fewer is None or self._fewer[0] != key:
                self._fewer = key, CompiledPlan(plan, usable, self._method)
            return UsableReadings(self._fewer[1], None)
        if turn not in self._whole:
            self._whole[turn] = CompiledPlan(plan, np.ones_like(usable), self._method)
        return UsableReadings(self._whole[turn], None if usable.all() else usable)

    def _method(self, name: str) -> ImageMethod:
        """A method by its name, for this recording alone where it carries something."""
        if name not in self._begun:
            method = self._own[name] if name in self._own else image_method(name)
            if isinstance(method, CarryingMethod):
                method = method.begin([decoder_for(plan).operator for plan in self._plans])
            self._begun[name] = method
        return self._begun[name]


class CompiledPlan:
    """Decoding of some readings (M,) of a plan, and solvers of its coefficients by method."""

    def __init__(
        self, plan: PatternPlan, readings: Mask, method: Callable[[str], ImageMethod]
    ) -> None:
        self._plan, self._readings, self._method = plan, readings, method
        self.decoder = decoder_for(plan, readings)
        self._solvers: dict[str, ImageSolver] = {}

    @cached_property
    def outliers(self) -> OutlierDetector:
        """Which of the readings cannot be right."""
        return OutlierDetector(self._plan, self._readings, self._throughput)

    @cached_property
    def _throughput(self) -> Throughput:
        return Throughput(self._plan, self._readings)

    @cached_property
    def decode(self) -> CoefficientDecoder:
        """From readings to coefficients."""
        return CoefficientDecoder(
            self.decoder,
            lambda: Prior(self.decoder.operator),
            redundant_combinations(self._plan, self._readings),
            self._throughput,
            drift_of(self._plan, self._readings),
        )

    def solver(self, method: str) -> ImageSolver:
        """From coefficients to an image by a method; InputError where it cannot be used."""
        if method not in self._solvers:
            self._solvers[method] = self._method(method).compile(self.decoder.operator)
        return self._solvers[method]


class UsableReadings:
    """A compiled plan, and which readings (M,) of a frame are ``usable``, None for all of them."""

    def __init__(self, compiled: CompiledPlan, usable: Mask | None) -> None:
        self._compiled, self._usable = compiled, usable
        self.decoder = compiled.decoder
        self.solver = compiled.solver

    @cached_property
    def measured(self) -> Mask:
        """Which coefficients (K,) there are."""
        if self._usable is None:
            return np.ones(self.decoder.operator.shape[0], dtype=bool)
        return self.decoder.measured(self._usable)

    @property
    def patterns(self) -> int:
        """Number of different patterns that an image rests on."""
        if self._usable is None:
            return self.decoder.index.size
        return int(np.count_nonzero(self.measured))

    @property
    def level(self) -> bool:
        """Whether the mean level of an image is told."""
        return self.decoder.level and bool(self.measured[self.decoder.operator.level])

    def outliers(self, signal: NDArray[Any]) -> Mask:
        """Which of the usable readings (M,) cannot be right."""
        return self._compiled.outliers(signal, self._usable)

    def decode(self, signal: NDArray[Any], variance: Floats) -> Coefficients:
        """From readings (M,) to coefficients."""
        return self._compiled.decode(signal, variance, self._usable)
