"""Noise, saturation and ranges of a recording without truth, from frames of a still scene."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from ..capture import Buckets, CwSpots, HistogramSpots, PulsedSpots, Recording, Spots
from ..chosen_methods import Methods
from ..ranging import RANGED, Ranges, pooled
from ..reconstructor import Reconstructor
from ..result import BASELINE, Result
from .depths import number

MAX_FRAMES = 256
"""Number of leading frames that are evaluated."""


def evaluate_recording(
    recording: Recording, ranging: Methods = None, *, weather: str | float | None = None
) -> dict[str, Any]:
    """Measure the noise of a recording of a still scene, by repetition.

    Noise is measured by differences of successive frames with the same patterns, so slow drift does
    not enter; it is None for fewer than two such frames.

    Parameters
    ----------
    recording
        A capture in memory or in its file; its first `MAX_FRAMES` frames are used.
    ranging, weather
        Methods and stated weather, as for `Reconstructor`.

    Returns
    -------
    dict
        Plain numbers, ready for JSON. ``frames``: their number. ``readings`` (None without an
        image) and ``taps`` (None without time of flight), with ``unit``, ``saturated`` (fraction),
        ``noise`` (rms, measured), ``expected`` (rms, of light and electronics as the capture states
        them, else None) and ``noise_ratio``, the first over the second. ``image``, of the
        zero-filled images: ``noise``, ``contrast`` (standard deviation over the pixels of their
        mean) and ``signal_over_noise``. ``spots``, by method, for each spot: ``range_m`` (mean),
        ``spread_m`` (measured), ``sigma_m`` (rms of those stated), ``spread_ratio``, the one over
        the other, and ``ranged`` (fraction of the frames). ``visibility``: that of all frames by
        `reconstruction.ranging.pooled`, None if unknown.

    Raises
    ------
    InputError
        If a method is unknown, or the plan does not determine the background.
    """
    setup, count = recording.setup, min(recording.frames, MAX_FRAMES)
    every, period = recording.batch(0, count), len(setup.plans)
    reconstructor = Reconstructor(setup, image=BASELINE, ranging=ranging, depth=[], weather=weather)
    results: list[Result] = []
    for frame in range(count):
        with suppress(InputError):  # saturated throughout
            results.append(reconstructor(every.between(frame, frame + 1)))
    visibility = pooled(result.visibility for result in results)
    in_turn = bool(results) and (period == 1 or len(results) == count)
    return {
        "frames": count,
        "readings": _readings(every.buckets, period) if setup.plan.shows_image else None,
        "taps": None if every.spots is None else _taps(every.spots),
        "image": _image(results, period) if in_turn and setup.plan.shows_image else None,
        "spots": {
            name: _spots([result.rangings[name] for result in results])
            for name in (results[0].rangings if results else ())
        },
        "visibility": None if visibility is None else visibility.numbers,
    }


def _readings(buckets: Buckets, period: int) -> dict[str, Any]:
    noise = _noise(buckets.signal, buckets.variance, buckets.usable, period)
    return {"unit": buckets.unit, **noise}


def _noise(
    values: Floats, variance: Floats, usable: NDArray[np.bool_], period: int
) -> dict[str, float | None]:
    both = usable[period:] & usable[:-period]
    noise = _rms(_differences(values, period)[both])
    stated = (variance[period:] + variance[:-period])[both] / 2
    expected = number(np.sqrt(stated.mean())) if stated.size else None
    return {
        "saturated": float(1 - usable.mean()),
        "noise": noise,
        "expected": expected,
        "noise_ratio": _ratio(noise, expected),
    }


def _taps(spots: Spots) -> dict[str, Any] | None:
    if isinstance(spots, HistogramSpots):
        counts = spots.counts.astype(np.float64)
        usable = np.broadcast_to(~spots.saturated[..., None], counts.shape)
        return {"unit": "count", **_noise(counts, counts, usable, 1)}
    if not isinstance(spots, CwSpots | PulsedSpots):
        return None
    electrons = spots.electrons(spots.taps)
    shot = spots.excess_noise_factor * np.maximum(electrons, 0)
    variance = shot + np.square(spots.noise_electrons)
    return {"unit": "electron", **_noise(electrons, variance, ~spots.saturated, 1)}


def _image(results: Sequence[Result], period: int) -> dict[str, float | None]:
    images = np.array([result.image for result in results], np.float64)
    noise, contrast = _rms(_differences(images, period)), float(images.mean(axis=0).std())
    return {"noise": noise, "contrast": contrast, "signal_over_noise": _ratio(contrast, noise)}


def _spots(rangings: Sequence[Ranges]) -> list[dict[str, float | None]]:
    ranged = np.array([[status in RANGED for status in each.status] for each in rangings])
    range_m, sigma_m = (
        np.array([getattr(each, name) for each in rangings]) for name in ("range_m", "sigma_m")
    )
    result = []
    for spot, has_range in enumerate(ranged.T):
        pairs = has_range[1:] & has_range[:-1]
        spread = _rms(_differences(range_m[:, spot], 1)[pairs])
        sigma = _rms(sigma_m[has_range, spot])
        result.append(
            {
                "range_m": number(range_m[has_range, spot].mean()) if has_range.any() else None,
                "spread_m": spread,
                "sigma_m": sigma,
                "spread_ratio": _ratio(spread, sigma),
                "ranged": float(has_range.mean()),
            }
        )
    return result


def _differences(values: Floats, period: int) -> Floats:
    """Differences of frames ``period`` apart, scaled to the noise of one."""
    return np.asarray((values[period:] - values[:-period]) / np.sqrt(2))


def _rms(values: Floats) -> float | None:
    return number(np.sqrt(np.mean(values**2))) if values.size else None


def _ratio(measured: float | None, expected: float | None) -> float | None:
    return measured / expected if measured is not None and expected else None
