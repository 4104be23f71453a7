"""Light that is too dear to trace in every test: means and standard errors, stored in a file.

A reference is found by other means than what is tested: by Mitsuba, or from one end alone. The
slow tier traces each anew and compares it with what is stored. To store them anew, where a test's
world has changed, run its slow variants with WRITE_REFERENCES=1.
"""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import pytest
from numpy.typing import NDArray

FILE = Path(__file__).parent / "data" / "references.json"
#: Stored ones have as many times the runs, so that they hardly add to the errors of what is tested.
MORE_RUNS = 4
#: Largest distance from what is stored, in standard errors: of up to 65 numbers, of long tails.
MAXIMUM_Z = 5.0


@dataclass(frozen=True)
class Reference:
    """Expected values and their standard errors, of so many repetitions."""

    mean: NDArray[np.float64]
    error: NDArray[np.float64]
    runs: int

    @classmethod
    def of(cls, repetitions: NDArray[np.float64]) -> Self:
        """From independent repetitions (seeds, ...)."""
        deviation = repetitions.std(axis=0, ddof=1)
        return cls(
            repetitions.mean(axis=0), deviation / np.sqrt(len(repetitions)), len(repetitions)
        )

    @property
    def variance(self) -> NDArray[np.float64]:
        """Of one repetition."""
        return self.error**2 * self.runs

    def z_score(self, repetitions: NDArray[np.float64], times: float = 1.0) -> NDArray[np.float64]:
        """Of what independent repetitions have more than `times` the reference."""
        other = Reference.of(np.asarray(repetitions))
        return (other.mean - times * self.mean) / np.hypot(other.error, times * self.error)


#: Makes repetitions, one for each of some seeds.
Trace = Callable[[range], NDArray[np.float64]]


@pytest.fixture(params=["stored", pytest.param("traced", marks=pytest.mark.slow)])
def reference(request: pytest.FixtureRequest) -> Callable[[str, Trace, int], Reference]:
    """The reference of a name, which so many repetitions make where it is traced."""
    return _traced if request.param == "traced" else lambda name, trace, runs: _stored(name)


def _stored(name: str) -> Reference:
    mean, error, runs = json.loads(FILE.read_text())[name]
    return Reference(np.array(mean), np.array(error), runs)


def _traced(name: str, trace: Trace, runs: int) -> Reference:
    if "WRITE_REFERENCES" in os.environ:
        _store(name, Reference.of(np.asarray(trace(range(runs, (MORE_RUNS + 1) * runs)))))
    fresh, stored = Reference.of(np.asarray(trace(range(runs)))), _stored(name)
    # Few repetitions may scatter little by chance, and one alone may have met a rare bright path.
    variance = np.maximum(stored.variance, fresh.variance)
    error = np.sqrt(variance * (1 / runs + 1 / stored.runs))
    assert np.all(np.abs(fresh.mean - stored.mean) < MAXIMUM_Z * error)
    return fresh


def _store(name: str, reference: Reference) -> None:
    everything = json.loads(FILE.read_text()) if FILE.exists() else {}
    short = np.vectorize(lambda value: float(f"{value:.7g}"))
    mean, error = short(reference.mean).tolist(), short(reference.error).tolist()
    everything[name] = [mean, error, reference.runs]
    lines = (f"{json.dumps(key)}: {json.dumps(everything[key])}" for key in sorted(everything))
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
