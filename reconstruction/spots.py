"""Time-of-flight readings of the four laser spots, one class for each method of measuring.

The lasers leave from the projector's pinhole; L is the whole optical path from there over the spot
to the detector.
"""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .schema import Stored

Reals = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Charge:
    """Integrated charge as counts of a converter: what they stand for, and their noise.

    Electrons are primary photo-electrons, before any gain: (counts - offset_counts) *
    electrons_per_count. ``noise_electrons`` is the rms electronics and ADC noise of one reading,
    nan where unknown; ``excess_noise_factor`` the variance of the charge per primary electron: 1
    for a PIN photodiode, F of R. J. McIntyre, IEEE Trans. Electron Devices 13, 164 (1966) for an
    avalanche diode.
    """

    electrons_per_count: Annotated[float, Stored("electron/count", sign="positive")]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float | Reals, Stored("electron", sign="not negative", nan=True)]
    excess_noise_factor: Annotated[float, Stored("1", sign="positive")]

    def electrons(self, counts: NDArray[Any]) -> Reals:
        """Primary photo-electrons that counts stand for."""
        return np.asarray((counts - self.offset_counts) * self.electrons_per_count)

    def variance(self, electrons: Reals) -> Reals:
        """Variance of readings of so many electrons, without the electronics' where unknown."""
        electronics = np.nan_to_num(self.noise_electrons) ** 2
        # A dead tap is no perfect tap.
        return np.asarray(self.excess_noise_factor * np.maximum(electrons, 1) + electronics)


@dataclass(frozen=True, eq=False)
class Spots:
    """What all methods share: unit vectors from the pinhole to the spots, and their detectors."""

    method: ClassVar[str]

    directions: Annotated[Reals, Stored("1", (4, 3))]
    detector_positions_m: Annotated[Reals, Stored("m", (4, 3))]

    @property
    def readings(self) -> NDArray[Any]:
        """What the detectors have recorded, frames first."""
        raise NotImplementedError

    def check(self) -> None:
        """Raise InputError unless the numbers fit together."""
        lengths = np.linalg.norm(self.directions, axis=1)
        if np.abs(lengths - 1).max() > 1e-3 or self.directions[:, 2].min() <= 0:
            raise InputError(
                "spots/directions must be unit vectors that point forward (z > 0); "
                f"their lengths are {np.round(lengths, 4).tolist()}"
            )


@dataclass(frozen=True, eq=False)
class CwSpots(Charge, Spots):
    """Continuous wave: tap k reads S_k = B + A cos(phi + phase_offset_k - tap_phase_k).

    phi = 2 pi f_k L / c with f_k the frequency of the tap. Several frequencies have at least three
    taps each, in any order. ``phase_offsets_rad`` is the calibrated phase at zero path length;
    ``periods`` the number of modulation periods that each tap accumulates; ``noise_electrons`` is
    each tap's own, as low frequencies integrate longer.
    """

    method = "cw"

    taps: Annotated[NDArray[Any], Stored("count", ("frames", 4, "taps"), "int32 or float64")]
    saturated: Annotated[Mask, Stored("1", ("frames", 4, "taps"), "bool")]
    noise_electrons: Annotated[
        float | Reals, Stored("electron", ("taps",), sign="not negative", nan=True)
    ]
    tap_frequencies_hz: Annotated[Reals, Stored("Hz", ("taps",), sign="positive")]
    tap_phases_rad: Annotated[Reals, Stored("rad", ("taps",))]
    phase_offsets_rad: Annotated[Reals, Stored("rad", ("taps",))]
    periods: Annotated[int, Stored("1", dtype="int64", sign="positive")]

    @property
    def readings(self) -> NDArray[Any]:
        """The taps."""
        return self.taps

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and every phase can be solved for."""
        super().check()
        check_taps("spots", self.tap_frequencies_hz, self.tap_phases_rad - self.phase_offsets_rad)


@dataclass(frozen=True, eq=False)
class PulsedSpots(Charge, Spots):
    """Pulses of light in three windows as long as they: background, first and second.

    Windows start ``window_starts_s`` after the pulse begins to leave, the second where the first
    ends; the background window sees no echo. Light arrives L / c + delay_offset after that moment.
    ``pulses`` is the number of pulses that each window accumulates.
    """

    method = "pulsed"

    taps: Annotated[NDArray[Any], Stored("count", ("frames", 4, 3), "int32 or float64")]
    saturated: Annotated[Mask, Stored("1", ("frames", 4, 3), "bool")]
    window_starts_s: Annotated[Reals, Stored("s", (3,))]
    pulse_width_s: Annotated[float, Stored("s", sign="positive")]
    pulses: Annotated[int, Stored("1", dtype="int64", sign="positive")]
    delay_offset_s: Annotated[float, Stored("s")]

    @property
    def readings(self) -> NDArray[Any]:
        """The three windows."""
        return self.taps

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and the windows do not overlap."""
        super().check()
        background, first, second = (self.window_starts_s / self.pulse_width_s).tolist()
        if abs(second - first - 1) > 1e-6:
            raise InputError(
                "spots/window_starts_s: the second window must start where the first ends, "
                f"pulse_width_s = {self.pulse_width_s:g} s later, not "
                f"{(second - first) * self.pulse_width_s:g} s"
            )
        if first - 1 + 1e-6 < background < second + 1 - 1e-6:
            raise InputError(
                "spots/window_starts_s: the background window overlaps the windows for the echo; "
                f"it must start {self.pulse_width_s:g} s before the first one or earlier, or after "
                "the second one has ended"
            )


@dataclass(frozen=True, eq=False)
class HistogramSpots(Spots):
    """Direct time of flight: arrivals per time bin, at most one in each of ``pulses`` cycles.

    Bin k covers start_s + [k, k + 1) bin_width_s after the pulse's centre leaves; light arrives
    L / c + delay_offset after that moment. The detector sees nothing before the first bin.
    ``response_sigma_s`` is the rms width of pulse and jitter together, a Gaussian; nan: unknown.
    ``piles_up`` where the first of many photons ends a cycle, so that later light is hidden by
    earlier; not where each stamp is that of a whole pulse, as of one that crosses a threshold.
    """

    method = "dtof"

    counts: Annotated[
        NDArray[Any],
        Stored("count", ("frames", 4, "bins"), "int32 or float64", sign="not negative"),
    ]
    saturated: Annotated[Mask, Stored("1", ("frames", 4), "bool")]
    bin_width_s: Annotated[float, Stored("s", sign="positive")]
    start_s: Annotated[float, Stored("s")]
    pulses: Annotated[int, Stored("1", dtype="int64", sign="positive")]
    response_sigma_s: Annotated[float, Stored("s", sign="positive", nan=True)]
    delay_offset_s: Annotated[float, Stored("s")]
    piles_up: Annotated[bool, Stored("1", dtype="bool")] = True

    @property
    def readings(self) -> NDArray[Any]:
        """The histograms."""
        return self.counts

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and the histograms can be true."""
        super().check()
        bins = self.counts.shape[-1]
        if bins < 3:
            raise InputError(f"spots/counts has {bins} bins; a histogram needs at least 3")
        most = self.counts.sum(axis=-1, dtype=np.float64).max(initial=0.0)
        if most > self.pulses * (1 + 1e-9):
            raise InputError(
                f"spots/counts holds {most:g} arrivals in one histogram of spots/pulses = "
                f"{self.pulses} cycles; there is at most one arrival per cycle"
            )


METHODS: dict[str, type[Spots]] = {
    part.method: part for part in (CwSpots, PulsedSpots, HistogramSpots)
}
"""The classes by their names in the file."""


@dataclass(frozen=True, eq=False)
class PatternTaps(Charge):
    """CW time of flight of every exposure on the bucket detector, for ranges of all pixels.

    Taps as those of `CwSpots`, of the light of one displayed pattern at ``detector_position_m``.
    """

    taps: Annotated[
        NDArray[Any], Stored("count", ("frames", "exposures", "pattern taps"), "int32 or float64")
    ]
    saturated: Annotated[Mask, Stored("1", ("frames", "exposures", "pattern taps"), "bool")]
    tap_frequencies_hz: Annotated[Reals, Stored("Hz", ("pattern taps",), sign="positive")]
    tap_phases_rad: Annotated[Reals, Stored("rad", ("pattern taps",))]
    phase_offsets_rad: Annotated[Reals, Stored("rad", ("pattern taps",))]
    detector_position_m: Annotated[Reals, Stored("m", (3,))]

    def check(self) -> None:
        """Raise InputError unless every phase can be solved for."""
        check_taps(
            "pattern_taps", self.tap_frequencies_hz, self.tap_phases_rad - self.phase_offsets_rad
        )


def check_taps(group: str, frequencies_hz: Reals, phases_rad: Reals) -> None:
    """Raise InputError unless each frequency has taps of three phases or more."""
    for frequency_hz in np.unique(frequencies_hz):
        phases = phases_rad[frequencies_hz == frequency_hz]
        where = f"{group}/tap_frequencies_hz: {frequency_hz:g} Hz"
        if phases.size < 3:
            raise InputError(f"{where} has {phases.size} tap(s); a phase needs at least 3")
        model = np.stack([np.ones_like(phases), np.cos(phases), np.sin(phases)])
        if np.linalg.matrix_rank(model, tol=1e-6) < 3:
            raise InputError(
                f"{where} has taps of fewer than 3 different phases in {group}/tap_phases_rad: "
                f"{np.round(phases, 6).tolist()}"
            )
