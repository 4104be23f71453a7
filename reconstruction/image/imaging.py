"""Image methods compiled for a pattern plan, for the usable readings of each frame."""

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
from .method import CarryingMethod, ImageMethod, ImageSolver, Motion
from .methods import image_method
from .prior import Prior


class Imaging:
    """Compiled decoders and solvers of one recording.

    Unusable readings get infinite noise, which needs no recompilation. Only if the patterns are not
    orthogonal, so that every coefficient rests on every reading, are decoder and solvers compiled
    for the usable readings, and cached as long as these stay the same.

    Parameters
    ----------
    *plans
        Plans of successive frames, repeated cyclically.
    own
        Unregistered methods by name.
    motion
        How images move from the last frame to this one.
    """

    def __init__(
        self,
        *plans: PatternPlan,
        own: Mapping[str, ImageMethod] = MappingProxyType({}),
        motion: Motion = lambda: None,
    ) -> None:
        self._plans = plans
        self._own, self._motion = own, motion
        self._whole: dict[int, CompiledPlan] = {}
        self._fewer: tuple[tuple[int, bytes], CompiledPlan] | None = None
        self._begun: dict[str, ImageMethod] = {}

    def of(self, usable: Mask, frame: int = 0) -> "UsableReadings":
        """Compiled plan of a frame.

        Parameters
        ----------
        usable
            Mask (M,) of its usable readings.
        frame
            Its index, which selects the plan.

        Raises
        ------
        InputError
            If the plan does not determine the background.
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
        """Image method by name; one that carries state is started once per recording."""
        if name not in self._begun:
            method = self._own[name] if name in self._own else image_method(name)
            if isinstance(method, CarryingMethod):
                operators = [decoder_for(plan).operator for plan in self._plans]
                method = method.begin(operators, self._motion)
            self._begun[name] = method
        return self._begun[name]


class CompiledPlan:
    """Decoder for some readings (M,) of a plan, and solvers of its coefficients by method."""

    def __init__(
        self, plan: PatternPlan, readings: Mask, method: Callable[[str], ImageMethod]
    ) -> None:
        self._plan, self._readings, self._method = plan, readings, method
        self.decoder = decoder_for(plan, readings)
        self._solvers: dict[str, ImageSolver] = {}

    @cached_property
    def outliers(self) -> OutlierDetector:
        """Detector of outlier readings."""
        return OutlierDetector(self._plan, self._readings, self._throughput)

    @cached_property
    def _throughput(self) -> Throughput:
        return Throughput(self._plan, self._readings)

    @cached_property
    def decode(self) -> CoefficientDecoder:
        """Decoder from readings to coefficients."""
        return CoefficientDecoder(
            self.decoder,
            lambda: Prior(self.decoder.operator),
            redundant_combinations(self._plan, self._readings),
            self._throughput,
            drift_of(self._plan, self._readings),
        )

    def solver(self, method: str) -> ImageSolver:
        """Solver of an image method; InputError if the method cannot be used."""
        if method not in self._solvers:
            self._solvers[method] = self._method(method).compile(self.decoder.operator)
        return self._solvers[method]


class UsableReadings:
    """Compiled plan of one frame with a mask ``usable`` (M,) of its readings, None for all."""

    def __init__(self, compiled: CompiledPlan, usable: Mask | None) -> None:
        self._compiled, self._usable = compiled, usable
        self.decoder = compiled.decoder
        self.solver = compiled.solver

    @cached_property
    def measured(self) -> Mask:
        """Mask (K,) of the measured coefficients."""
        if self._usable is None:
            return np.ones(self.decoder.operator.shape[0], dtype=bool)
        return self.decoder.measured(self._usable)

    @property
    def patterns(self) -> int:
        """Number of distinct patterns that the image rests on."""
        if self._usable is None:
            return self.decoder.index.size
        return int(np.count_nonzero(self.measured))

    @property
    def has_dc(self) -> bool:
        """Whether the DC coefficient is measured."""
        return self.decoder.has_dc and bool(self.measured[self.decoder.operator.dc_row])

    def outliers(self, signal: NDArray[Any]) -> Mask:
        """Mask (M,) of usable readings that are outliers."""
        return self._compiled.outliers(signal, self._usable)

    def decode(self, signal: NDArray[Any], variance: Floats) -> Coefficients:
        """Coefficients of readings (M,) with this ``variance`` (M,)."""
        return self._compiled.decode(signal, variance, self._usable)
