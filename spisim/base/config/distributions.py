"""Distributions in configuration files, from which values are drawn at random.

Each value has its own random stream, named by keys, so fixing or adding one changes no other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any
from zlib import crc32

import numpy as np
from pydantic import Discriminator, Field, StrictBool, Tag, model_validator
from pydantic_core import PydanticCustomError

from spisim.base.config.fields import Number, Positive, Section

#: Minimum probability within the bounds: rejection sampling would take too long below it.
MIN_WITHIN = 1e-4
#: Up to here floating-point numbers hold all integers.
MAX_INTEGER = 2**53


def stream(seed: int, *keys: str | int) -> np.random.Generator:
    """A random generator that depends on the seed and all keys alone."""
    words = [crc32(key.encode()) if isinstance(key, str) else key for key in keys]
    return np.random.default_rng([seed, *words])


def _rising(bounds: tuple[float, float]) -> None:
    low, high = bounds
    if not 0 < high - low < math.inf:
        raise PydanticCustomError(
            "range", "needs a lower and a higher bound, not {bounds}", {"bounds": list(bounds)}
        )


class Uniform(Section):
    """Uniform between two bounds."""

    uniform: tuple[Number, Number]
    """Lower and upper bound."""
    integer: StrictBool = False
    """Whether to draw integers, both bounds included."""

    @model_validator(mode="after")
    def _is_a_range(self) -> Uniform:
        _rising(self.uniform)
        if self.integer and any(b % 1 or abs(b) > MAX_INTEGER for b in self.uniform):
            raise PydanticCustomError(
                "range",
                "bounds of integers should be integers within ±2⁵³, not {bounds}",
                {"bounds": list(self.uniform)},
            )
        return self

    def draw(self, rng: np.random.Generator) -> float | int:
        """Draw one value."""
        low, high = self.uniform
        if self.integer:
            return int(rng.integers(int(low), int(high) + 1))
        return float(rng.uniform(low, high))


class LogUniform(Section):
    """The logarithm is uniform between two positive bounds."""

    log_uniform: tuple[Positive, Positive]
    """Lower and upper bound."""

    @model_validator(mode="after")
    def _is_a_range(self) -> LogUniform:
        _rising(self.log_uniform)
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """Draw one value."""
        low, high = self.log_uniform
        return float(min(max(math.exp(rng.uniform(math.log(low), math.log(high))), low), high))


class Normal(Section):
    """Normal distribution, redrawn until the value lies `within` two bounds, if given."""

    normal: tuple[Number, Positive]
    """Mean and standard deviation."""
    within: tuple[Number, Number] | None = None
    """Lower and upper bound of the values."""

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
            raise PydanticCustomError("range", "within is too narrow: almost no value falls there")
        return self

    def draw(self, rng: np.random.Generator) -> float:
        """Draw one value."""
        low, high = self.within or (-math.inf, math.inf)
        while True:
            value = float(rng.normal(*self.normal))
            if low <= value <= high:
                return value


class Choice(Section):
    """One of several values of any kind, equally likely unless `weights` are given."""

    choice: Annotated[tuple[Any, ...], Field(min_length=1)]
    """The values, which may be distributions themselves."""
    weights: tuple[Annotated[Number, Field(ge=0)], ...] | None = None
    """Relative probability of each value."""

    @model_validator(mode="after")
    def _weights_fit(self) -> Choice:
        if self.weights is None:
            return self
        if len(self.weights) != len(self.choice) or not 0 < sum(self.weights) < math.inf:
            raise PydanticCustomError(
                "choice", "weights should be one for each choice, with a finite sum above 0"
            )
        return self

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw one of the values."""
        weights = self.weights or (1.0,) * len(self.choice)
        index = rng.choice(len(self.choice), p=np.divide(weights, sum(weights)))
        return self.choice[int(index)]


KINDS = {"uniform": Uniform, "log_uniform": LogUniform, "normal": Normal, "choice": Choice}


def is_distribution(data: Any) -> bool:
    """Whether a value of a configuration file is a distribution."""
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
