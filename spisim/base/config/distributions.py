"""Random values as a configuration file describes them: what they are drawn from.

Every value has a random stream of its own, named by keys, so that fixing or adding one value leaves
all others as they were.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any
from zlib import crc32

import numpy as np
from pydantic import Discriminator, Field, StrictInt, Tag, model_validator
from pydantic_core import PydanticCustomError

from spisim.base.config.fields import Number, Positive, Section

#: Fewer values than this share within bounds are refused: they would be drawn for ever.
MIN_WITHIN = 1e-4
#: Larger ones are drawn as floating-point numbers.
_Whole = Annotated[StrictInt, Field(ge=-(2**62), le=2**62)]


def stream(seed: int, *keys: str | int) -> np.random.Generator:
    """Random numbers that depend on the seed and all keys, and on nothing else."""
    words = [crc32(key.encode()) if isinstance(key, str) else key for key in keys]
    return np.random.default_rng([seed, *words])


def _rising(bounds: tuple[float, float]) -> None:
    low, high = bounds
    if not 0 < high - low < math.inf:
        raise PydanticCustomError(
            "range", "needs a lower and a higher bound, not {bounds}", {"bounds": list(bounds)}
        )


class Uniform(Section):
    """Every value between two bounds alike; whole numbers, both bounds included, if both are."""

    uniform: tuple[_Whole, _Whole] | tuple[Number, Number]
    """Both bounds."""

    @model_validator(mode="after")
    def _is_a_range(self) -> Uniform:
        _rising(self.uniform)
        return self

    def draw(self, rng: np.random.Generator) -> float | int:
        """One value."""
        low, high = self.uniform
        if isinstance(low, int) and isinstance(high, int):
            return int(rng.integers(low, high + 1))
        return float(rng.uniform(low, high))


class LogUniform(Section):
    """Every factor alike: the logarithm is uniform between those of two bounds."""

    log_uniform: tuple[Positive, Positive]
    """Both bounds."""

    @model_validator(mode="after")
    def _is_a_range(self) -> LogUniform:
        _rising(self.log_uniform)
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        low, high = self.log_uniform
        return float(min(max(math.exp(rng.uniform(math.log(low), math.log(high))), low), high))


class Normal(Section):
    """Mean and standard deviation; drawn again until it lies `within` two bounds, if given."""

    normal: tuple[Number, Positive]
    """Mean and standard deviation."""
    within: tuple[Number, Number] | None = None
    """Bounds that no value lies beyond."""

    @model_validator(mode="after")
    def _can_be_within(self) -> Normal:
        if self.within is None:
            return self
        _rising(self.within)
        mean, spread = self.normal
        if not self.within[0] - 3 * spread < mean < self.within[1] + 3 * spread:
            raise PydanticCustomError(
                "range", "within lies more than three standard deviations from the mean"
            )
        below = [math.erfc((mean - bound) / spread / math.sqrt(2)) / 2 for bound in self.within]
        if below[1] - below[0] < MIN_WITHIN:
            raise PydanticCustomError(
                "range", "within is too narrow: values hardly ever fall there"
            )
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        low, high = self.within or (-math.inf, math.inf)
        while True:
            value = float(rng.normal(*self.normal))
            if low <= value <= high:
                return value


class Choice(Section):
    """One of several values, of any kind; `weights` say how often, alike without."""

    choice: Annotated[tuple[Any, ...], Field(min_length=1)]
    """The values, which may be drawn themselves."""
    weights: tuple[Annotated[Number, Field(ge=0)], ...] | None = None
    """How often each, as a share of their sum."""

    @model_validator(mode="after")
    def _weights_fit(self) -> Choice:
        if self.weights is None:
            return self
        if len(self.weights) != len(self.choice) or not 0 < sum(self.weights) < math.inf:
            raise PydanticCustomError(
                "choice", "weights should be one for each choice, not all zero, of a finite sum"
            )
        return self

    def draw(self, rng: np.random.Generator) -> Any:
        """One of the values."""
        weights = self.weights or (1.0,) * len(self.choice)
        position = rng.choice(len(self.choice), p=np.divide(weights, sum(weights)))
        return self.choice[int(position)]


KINDS = {"uniform": Uniform, "log_uniform": LogUniform, "normal": Normal, "choice": Choice}


def is_distribution(data: Any) -> bool:
    """Whether this, from a configuration file, says what a value is drawn from."""
    return isinstance(data, Mapping) and any(field in data for field in KINDS)


def _tag(data: Any) -> str:
    for field, kind in KINDS.items():
        if isinstance(data, kind) or (isinstance(data, Mapping) and field in data):
            return f"by {field}"
    return ""


Distribution = Annotated[
    Annotated[Uniform, Tag("by uniform")]
    | Annotated[LogUniform, Tag("by log_uniform")]
    | Annotated[Normal, Tag("by normal")]
    | Annotated[Choice, Tag("by choice")],
    Discriminator(_tag),
]
