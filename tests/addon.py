"""A package of another author: a sensor, a method of ranging, a kind of weather and an export."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from reconstruction.capture import Spots
from reconstruction.capture.schema import Stored
from reconstruction.ranging.ranges import MIN_SIGNAL, Paths, Ranges, ranges_from_paths
from spisim.atmosphere import explicit, henyey_greenstein
from spisim.atmosphere.weather import Weather
from spisim.config import Count, Positive, Section
from spisim.instrument import Emission, Reading, Spad, SpotLight, TofDetector
from spisim.instrument.sensor import Random

Reals = NDArray[np.float64]


class SiPm(Spad):
    """Many small single-photon diodes on one output; none fires twice in an exposure."""

    type: Literal["sipm"]
    cells: Count

    def expected_counts(self, primaries: Reals, time_s: float | Reals) -> Reals:
        return np.asarray(self.cells * -np.expm1(-primaries / self.cells))

    def draw_counts(
        self, primaries: Reals, time_s: float | Reals, rng: np.random.Generator
    ) -> NDArray[np.int32]:
        fired = -np.expm1(-primaries / self.cells)
        return rng.binomial(self.cells, fired).astype(np.int32)


@dataclass(frozen=True, eq=False)
class BeatSpots(Spots):
    """Beat frequency of the echo with the chirp that goes out."""

    method = "fmcw"

    beats_hz: Annotated[Reals, Stored("Hz", ("frames", 4))]
    beat_sigmas_hz: Annotated[Reals, Stored("Hz", ("frames", 4), sign="not negative")]
    signal_electrons: Annotated[Reals, Stored("electron", ("frames", 4))]
    chirp_hz_per_s: Annotated[float, Stored("Hz/s", sign="positive")]

    @property
    def readings(self) -> NDArray[Any]:
        return self.beats_hz


class FmcwTof(Section):
    """A chirp whose echo beats with it; noise is that of the light alone."""

    method: Literal["fmcw"]
    chirp_hz: Positive
    time_s: Positive
    detector: TofDetector

    @property
    def unambiguous_range_m(self) -> float:
        return c * self.time_s / 2

    @property
    def frame_time_s(self) -> float:
        return self.time_s

    @property
    def reading(self) -> Reading:
        return Reading("chirp", self.time_s, self.time_s, self.time_s, converted=False)

    def check_bins(self, bin_width_m: float) -> None:
        """The beat is that of the mean path."""

    def record(self, light: SpotLight, directions: Reals, rng: Random) -> BeatSpots:
        echo = light.echo_per_s.sum(axis=-1)
        path_m = (light.echo_per_s @ light.path_length_m) / echo
        sigma_m = self.path_sigma_m(path_m, echo, light.steady_per_s)
        if rng is not None:
            path_m = path_m + sigma_m * rng.standard_normal(path_m.shape)
        slope = self.chirp_hz / self.time_s
        return BeatSpots(
            directions=directions,
            detector_positions_m=self.detector.spot_positions_m,
            beats_hz=path_m / c * slope,
            beat_sigmas_hz=sigma_m / c * slope,
            signal_electrons=echo * self.time_s,
            chirp_hz_per_s=slope,
        )

    def path_sigma_m(self, path_m: Reals, echo_per_s: Reals, steady_per_s: Reals) -> Reals:
        snr = echo_per_s / np.sqrt(echo_per_s + steady_per_s) * np.sqrt(self.time_s)
        return np.asarray(np.sqrt(6) / np.pi * c / self.chirp_hz / snr)

    def emission(self, power_w: float) -> Emission:
        return Emission(power_w, power_w * self.time_s, self.time_s)

    def warnings(self, steady_per_s: float, echo_per_s: float) -> list[str]:
        return []


class Beat:
    """Path length in proportion to the beat."""

    title = "beat"
    reads = BeatSpots

    def compile(self, spots: Spots) -> Any:
        def solve(spots: BeatSpots) -> Ranges:
            never = np.zeros(4, np.bool_)
            per_hz = c / spots.chirp_hz_per_s
            signal = spots.signal_electrons[0]
            paths = Paths(
                path_m=spots.beats_hz[0] * per_hz,
                sigma_m=spots.beat_sigmas_hz[0] * per_hz,
                signal_electrons=signal,
                background_electrons=np.zeros(4),
                saturated=never,
                no_signal=signal < MIN_SIGNAL**2,
                ambiguous=never,
            )
            return ranges_from_paths(paths, spots)

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        return np.inf


BEAT = Beat()


class Dust(Weather):
    """Mineral dust, by its mass."""

    mass_mg_per_m3: Positive

    def made(self, folder: Path, wavelength_nm: float) -> Any:
        return explicit(5e-4 * self.mass_mg_per_m3, 0.9, henyey_greenstein(0.7))


def write_arrays(samples: Any, folder: Path, per_file: int) -> list[Path]:
    """The readings of all samples as one NumPy file."""
    folder.mkdir(exist_ok=True)
    counts = np.concatenate([sample.capture.buckets.counts for sample in samples])
    np.save(folder / "counts.npy", counts)
    return [folder / "counts.npy"]


ENTRIES = {
    "spisim.sensors": {"sipm": "addon:SiPm"},
    "spisim.tofs": {"fmcw": "addon:FmcwTof"},
    "reconstruction.readings": {"fmcw": "addon:BeatSpots"},
    "reconstruction.rangings": {"fmcw": "addon:BEAT"},
    "spisim.weather": {"dust": "addon:Dust"},
    "spisim.exports": {"npy": "addon:write_arrays"},
}
