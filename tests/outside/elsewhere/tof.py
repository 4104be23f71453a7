"""A method of time of flight: a stopwatch for each spot, its readings and what is made of them."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from reconstruction.capture import Spots
from reconstruction.capture.schema import Stored
from reconstruction.ranging import Paths, ranges_from_paths
from spisim.base.config import Positive, Section
from spisim.instrument import Emission, Reading, TofDetector


@dataclass(frozen=True, eq=False)
class StopwatchSpots(Spots):
    """The mean delay of the light, and how many electrons told it."""

    method = "stopwatch"

    delay_s: Annotated[NDArray[Any], Stored("s", ("frames", 4))]
    electrons: Annotated[NDArray[Any], Stored("electron", ("frames", 4))]
    tick_s: Annotated[float, Stored("s", sign="positive")]

    @property
    def readings(self):
        return self.delay_s


class Mean:
    title = "mean delay"
    reads = StopwatchSpots

    def compile(self, spots, optics=None):
        def solve(spots, brightness=None):
            no_return = np.zeros(4, bool)
            electrons = spots.electrons[0]
            sigma_m = c * spots.tick_s / np.sqrt(np.maximum(electrons, 1))
            paths = Paths(
                path_m=c * spots.delay_s[0],
                sigma_m=sigma_m,
                signal_electrons=electrons,
                background_electrons=0 * electrons,
                saturated=no_return,
                no_signal=electrons < 1,
                ambiguous=no_return,
            )
            return ranges_from_paths(paths, spots)

        return solve

    def unambiguous_range_m(self, spots):
        return np.inf


METHOD = Mean()


class Stopwatch(Section):
    """One pulse a frame for each spot."""

    method: Literal["stopwatch"]
    tick_s: Positive
    pulse_s: Positive
    detector: TofDetector

    @property
    def unambiguous_range_m(self):
        return 100.0

    @property
    def frame_time_s(self):
        return 1e-3

    @property
    def reading(self):
        return Reading("delay", self.pulse_s, self.pulse_s, self.pulse_s, converted=False)

    @property
    def edge_s(self):
        return self.pulse_s

    def check_bins(self, bin_width_m):
        pass

    def record(self, light, optics, rng):
        echo = light.echo_per_s * self.pulse_s
        electrons = echo.sum(axis=-1)
        delay_s = echo @ light.path_length_m / np.maximum(electrons, 1e-9) / c
        if rng is not None:
            electrons = rng.poisson(electrons).astype(float)
            delay_s = rng.normal(delay_s, self.tick_s / np.sqrt(np.maximum(electrons, 1)))
        return StopwatchSpots(
            **vars(optics),
            delay_s=delay_s,
            electrons=electrons,
            tick_s=self.tick_s,
        )

    def path_sigma_m(self, path_m, echo_per_s, steady_per_s):
        return c * self.tick_s / np.sqrt(np.maximum(echo_per_s * self.pulse_s, 1e-9))

    def emission(self, power_w):
        energy = power_w * self.pulse_s
        return Emission(energy / self.frame_time_s, energy, self.pulse_s)

    def warnings(self, steady_per_s, echo_per_s):
        return []
