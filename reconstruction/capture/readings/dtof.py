"""Direct time of flight: histograms of single-photon arrivals."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Mask
from ...base.constants import c
from ...base.errors import InputError
from ..schema import Stored
from ..spots import SPOTS_AXIS, Spots, check_duration


@dataclass(frozen=True, eq=False)
class HistogramSpots(Spots):
    """Direct time of flight: arrivals per time bin, at most one in each of ``pulses`` cycles.

    Bin k covers start_s + [k, k + 1) bin_width_s after the pulse's centre leaves; light arrives L /
    c + delay_offset_s after that. The detector is blind before the first bin. ``response_sigma_s``
    is the rms width of a Gaussian pulse and jitter together; nan if unknown. With ``piles_up`` the
    first of many photons ends a cycle and hides later light; without, each time stamp is that of a
    whole pulse that crosses a threshold. ``laser_energy_j`` is the energy of all pulses; nan if
    unknown.

    A ``response`` that is no Gaussian is given by its rate at rising times ``response_s`` after the
    delay, linear between; nothing arrives outside.
    """

    method = "dtof"

    counts: Annotated[
        NDArray[Any],
        Stored("count", ("frames", SPOTS_AXIS, "bins"), "int32 or float64", sign="not negative"),
    ]
    saturated: Annotated[Mask, Stored("1", ("frames", SPOTS_AXIS), "bool")]
    bin_width_s: Annotated[float, Stored("s", sign="positive")]
    start_s: Annotated[float, Stored("s")]
    pulses: Annotated[int, Stored("1", dtype="int64", sign="positive")]
    response_sigma_s: Annotated[float, Stored("s", sign="positive", nan=True)]
    delay_offset_s: Annotated[float, Stored("s")]
    piles_up: Annotated[bool, Stored("1", dtype="bool")] = True
    laser_energy_j: Annotated[float, Stored("J", sign="positive", nan=True)] = np.nan
    response_s: Annotated[Floats | None, Stored("s", ("response samples",))] = None
    response: Annotated[Floats | None, Stored("1", ("response samples",), sign="not negative")] = (
        None
    )

    @property
    def readings(self) -> NDArray[Any]:
        """The histograms."""
        return self.counts

    @property
    def summary(self) -> str:
        """Description of the measurement in a few words."""
        bins = self.counts.shape[-1]
        return f"histograms, {bins} bins of {1e9 * self.bin_width_s:.4g} ns"

    def delay(self, path_m: Floats) -> Floats:
        """Arrival of light of a path (...) in bins, from the lower edge of the first."""
        arrival_s = path_m / c + self.delay_offset_s - self.start_s
        return np.asarray(arrival_s / self.bin_width_s)

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and the histograms are possible."""
        super().check()
        check_duration("spots/bin_width_s", self.bin_width_s)
        bins = self.counts.shape[-1]
        if bins < 3:
            raise InputError(f"spots/counts has {bins} bins; a histogram needs at least 3")
        check_response(self.response_s, self.response)
        maximum = self.counts.sum(axis=-1, dtype=np.float64).max(initial=0.0)
        if maximum > self.pulses * (1 + 1e-9):
            raise InputError(
                f"spots/counts holds {maximum:g} arrivals in one histogram of spots/pulses = "
                f"{self.pulses} cycles; at most one arrival per cycle is possible"
            )


def check_response(times_s: Floats | None, rates: Floats | None) -> None:
    """Raise InputError unless there are both or neither, with rising times and some light."""
    if (times_s is None) != (rates is None):
        raise InputError("spots/response and spots/response_s belong together; one is missing")
    if times_s is None or rates is None:
        return
    if times_s.size < 3 or (np.diff(times_s) <= 0).any():
        raise InputError("spots/response_s needs at least 3 rising times")
    if not (rates > 0).any():
        raise InputError("spots/response is 0 everywhere")


READINGS = HistogramSpots
