"""Time-of-flight readings of the spots from arrays."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import usual_float_errors
from ...base.errors import InputError
from ...operators import NO_PATTERN
from ..model import Capture
from ..readings.cw import CwSpots
from ..readings.dtof import HistogramSpots
from ..readings.pulsed import PulsedSpots
from ..spots import MAX_SPOTS, USUAL_SPOTS, Spots
from .about import checked_about
from .arrays import capture_from_readings

QUARTERS_RAD = (0.0, np.pi / 2, np.pi, 3 * np.pi / 2)
"""Phases of four taps, a quarter of a period apart."""

TAPS_ABOUT: dict[str, float] = {
    "electrons_per_count": 1.0,
    "offset_counts": 0.0,
    "noise_electrons": float("nan"),
    "excess_noise_factor": 1.0,
    "saturation_counts": float("inf"),
}
"""Properties of the spots' detectors and their defaults: fields of `Charge`, and the counts from
which on a reading is saturated."""

NO_METADATA: Mapping[str, float] = MappingProxyType({})


class SpotGeometry(NamedTuple):
    """Unit vectors (S, 3) from the pinhole to S spots, and detector positions (S, 3) in metres.

    By default four spots lie straight ahead and the detectors are at the pinhole.
    """

    directions: ArrayLike = ((0.0, 0.0, 1.0),) * USUAL_SPOTS
    detector_positions_m: ArrayLike | None = None

    @property
    def spots(self) -> int:
        """Number of spots; raises InputError unless it is 1 to `MAX_SPOTS`."""
        shape = np.shape(self.directions)
        if not (len(shape) == 2 and shape[1] == 3 and 1 <= shape[0] <= MAX_SPOTS):
            raise InputError(
                f"directions have shape {shape}, expected (S, 3): x, y, z of 1 to {MAX_SPOTS} spots"
            )
        return int(shape[0])

    def fields(self) -> dict[str, Any]:
        """Fields of `Spots`, with unit directions; raises InputError for other shapes."""
        shape, positions_m = (self.spots, 3), self.detector_positions_m
        positions_m = np.zeros(shape) if positions_m is None else np.asarray(positions_m, float)
        if positions_m.shape != shape:
            raise InputError(
                f"detector_positions_m has shape {positions_m.shape}, expected {shape}: x, y, z"
            )
        directions = np.asarray(self.directions, float)
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        if not (lengths > 0).all():
            raise InputError("directions hold a vector of zero length")
        return {"directions": directions / lengths, "detector_positions_m": positions_m}


AHEAD = SpotGeometry()


@usual_float_errors
def spots_from_taps(
    taps: ArrayLike,
    frequencies_hz: ArrayLike,
    *,
    phases_rad: ArrayLike = QUARTERS_RAD,
    phase_offsets_rad: ArrayLike = 0.0,
    geometry: SpotGeometry = AHEAD,
    about: Mapping[str, float] = NO_METADATA,
) -> CwSpots:
    """Continuous-wave (iToF) readings of S spots, the number in ``geometry``.

    Raises InputError if the taps have another shape, or frequencies or phases are impossible.

    Parameters
    ----------
    taps : array, (S, K), (frames, S, K), (S * frames, K) or (frames, S * K)
        Counts of K = F * P taps of each spot: all P phases of the first frequency, then of the
        next.
    frequencies_hz : float or array, (F,)
        Modulation frequencies.
    phases_rad : array, (P,)
        Phases of the taps of each frequency.
    phase_offsets_rad : float or array, (F,)
        Calibrated phase at zero path length, of each frequency.
    geometry : SpotGeometry
        Directions of the spots and positions of their detectors.
    about : mapping
        Detector properties by the names of `TAPS_ABOUT`.
    """
    each_hz, phases = np.atleast_1d(frequencies_hz), np.atleast_1d(phases_rad)
    offsets = np.broadcast_to(phase_offsets_rad, each_hz.shape)
    what = f"{phases.size} phases of {each_hz.size} frequency(ies)"
    readings = _of_spots(taps, each_hz.size * phases.size, geometry.spots, what)
    spots = CwSpots(
        taps=readings,
        tap_frequencies_hz=np.repeat(each_hz.astype(float), phases.size),
        tap_phases_rad=np.tile(phases.astype(float), each_hz.size),
        phase_offsets_rad=np.repeat(offsets.astype(float), phases.size),
        periods=1,
        **geometry.fields(),
        **_charge(readings, about),
    )
    spots.check()
    return spots


@usual_float_errors
def spots_from_windows(
    taps: ArrayLike,
    window_starts_s: ArrayLike,
    pulse_width_s: float,
    *,
    pulses: int = 1,
    delay_offset_s: float = 0.0,
    geometry: SpotGeometry = AHEAD,
    about: Mapping[str, float] = NO_METADATA,
) -> PulsedSpots:
    """Pulsed readings of S spots, the number in ``geometry``.

    Raises InputError if the taps have another shape, or windows overlap or leave gaps.

    Parameters
    ----------
    taps : array, (S, W), (frames, S, W), (S * frames, W) or (frames, S * W)
        Counts of W windows of each spot: background, then two or more for the echo.
    window_starts_s : array, (W,)
        Opening of each window after the pulse begins to leave.
    pulse_width_s : float
        Duration of the rectangular pulse and of each window.
    pulses : int
        Pulses that each window accumulates.
    delay_offset_s : float
        Calibrated delay: light arrives L / c + delay_offset_s after it left.
    geometry, about
        As for `spots_from_taps`.
    """
    starts = np.atleast_1d(window_starts_s).astype(float)
    readings = _of_spots(taps, starts.size, geometry.spots, f"{starts.size} windows")
    spots = PulsedSpots(
        taps=readings,
        window_starts_s=starts,
        pulse_width_s=pulse_width_s,
        pulses=pulses,
        delay_offset_s=delay_offset_s,
        **geometry.fields(),
        **_charge(readings, about),
    )
    spots.check()
    return spots


@usual_float_errors
def spots_from_histograms(
    counts: ArrayLike,
    bin_width_s: float,
    pulses: int,
    *,
    start_s: float = 0.0,
    response_sigma_s: float = float("nan"),
    delay_offset_s: float = 0.0,
    saturated: ArrayLike = False,
    geometry: SpotGeometry = AHEAD,
) -> HistogramSpots:
    """Histograms (dToF) of S spots, the number in ``geometry``.

    Raises InputError if the counts have another shape, or more arrivals than cycles.

    Parameters
    ----------
    counts : array, (S, B), (frames, S, B), (S * frames, B) or (B, S)
        Arrivals in B time bins of each spot.
    bin_width_s : float
    pulses : int
        Cycles, each of which contributes at most one arrival.
    start_s : float
        Start of the first bin after the pulse's centre leaves.
    response_sigma_s : float
        Rms width of pulse and jitter together; nan to fit it.
    delay_offset_s : float
        Calibrated delay: light arrives L / c + delay_offset_s after it left.
    saturated : bool or array, (frames, S)
        Histograms to ignore.
    geometry
        As for `spots_from_taps`.
    """
    array, count = _numbers(counts), geometry.spots
    if array.ndim == 2 and array.shape[1] == count != array.shape[0]:
        array = array.T
    if array.ndim == 2 and array.shape[0] % count == 0:
        array = array.reshape(-1, count, array.shape[1])
    if array.ndim != 3 or array.shape[1] != count:
        raise InputError(
            f"the histograms have shape {array.shape}; a line for each of the {count} spots is "
            "expected, frame after frame, or a column for each"
        )
    spots = HistogramSpots(
        counts=array,
        saturated=np.broadcast_to(np.asarray(saturated, bool), array.shape[:2]).copy(),
        bin_width_s=bin_width_s,
        start_s=start_s,
        pulses=pulses,
        response_sigma_s=response_sigma_s,
        delay_offset_s=delay_offset_s,
        **geometry.fields(),
    )
    spots.check()
    return spots


def capture_from_spots(spots: Spots) -> Capture:
    """Capture (source hardware) of ranges only: its image is a single dark pixel."""
    return capture_from_readings(np.zeros((len(spots.readings), 1)), NO_PATTERN, spots=spots)


def by_spot(taps: NDArray[Any], spot: NDArray[Any]) -> NDArray[Any]:
    """Readings (frames, S, K) of lines (S * frames, K) in any order that name their spot.

    Raises InputError unless all spots have as many lines.
    """
    numbers, lines = np.unique(spot, return_counts=True)
    if (lines != lines[0]).any():
        raise InputError(
            f"the column of the spots names spot {numbers[lines.argmin()]:g} in {lines.min()} "
            f"line(s), spot {numbers[lines.argmax()]:g} in {lines.max()}: as many of each are "
            "needed, the k-th of each spot for frame k"
        )
    order = np.argsort(spot, kind="stable").reshape(len(numbers), -1)
    return taps[order.T]


def added(spots: Spots, frames: int) -> Spots:
    """Spots of ``frames``, each the sum of as many successive frames.

    Counts and offsets add, and noise does in squares. Raises InputError if frames would be left.
    """
    each, rest = divmod(len(spots.readings), frames)
    if rest or not each:
        raise InputError(
            f"{len(spots.readings)} frame(s) of spots, {frames} of patterns: as many are needed, "
            "or several of spots for each of patterns, which are added"
        )

    def total(counts: NDArray[Any]) -> NDArray[Any]:
        return counts.reshape(frames, each, *counts.shape[1:]).sum(axis=1)

    changes: dict[str, Any] = {"saturated": total(spots.saturated) > 0}  # type: ignore[attr-defined]
    if isinstance(spots, HistogramSpots):
        changes |= {"counts": total(spots.counts), "pulses": each * spots.pulses}
    elif isinstance(spots, CwSpots | PulsedSpots):
        changes |= {
            "taps": total(spots.taps),
            "offset_counts": each * spots.offset_counts,
            "noise_electrons": np.sqrt(each) * spots.noise_electrons,
        }
        again = "periods" if isinstance(spots, CwSpots) else "pulses"
        changes[again] = each * getattr(spots, again)
    return replace(spots, **changes)


def _of_spots(taps: ArrayLike, each: int, spots: int, what: str) -> NDArray[Any]:
    """Readings (frames, spots, each) from an array of any of the layouts."""
    array = _numbers(taps)
    columns = array.shape[-1] if array.ndim else 0
    by_spot = array.ndim == 2 and columns == each and len(array) % spots == 0
    by_frame = array.ndim in (1, 2) and columns == spots * each
    if not (by_spot or by_frame or (array.ndim == 3 and array.shape[1:] == (spots, each))):
        raise InputError(
            f"the taps have shape {array.shape}; {what} give {each} numbers of each of the {spots} "
            f"spots: {each} columns, a line for each spot, frame after frame, or {spots * each} "
            "columns, a line for each frame; of a text with more, name those of the taps "
            "(--columns)"
        )
    return array.reshape(-1, spots, each)


def _numbers(values: ArrayLike) -> NDArray[Any]:
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        raise InputError(f"the readings of the spots are of type {array.dtype}, not real numbers")
    return array.astype(np.int64 if array.dtype.kind in "iu" else np.float64)


def _charge(readings: NDArray[Any], about: Mapping[str, float]) -> dict[str, Any]:
    """Fields of `Charge`, and the mask of saturated readings."""
    given = checked_about(about, TAPS_ABOUT)
    return {"saturated": readings >= given.pop("saturation_counts"), **given}
