"""Metrics of a result against the truth of a simulation."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import usual_float_errors
from ..base.errors import InputError
from ..capture import Capture, FrameTruth
from ..depth import pixel_rays
from ..ranging import Ranges
from ..result import BASELINE, Result
from .depths import depth_metrics, number


@usual_float_errors
def evaluate(result: Result, recording: Capture) -> dict[str, Any]:
    """Compare a result with the truth of its frame.

    Parameters
    ----------
    result
        Result of a frame of ``recording``.
    recording
        Simulated capture.

    Returns
    -------
    dict
        Plain numbers, ready for JSON; what does not exist is empty or None. ``frame``: its index.
        ``images``, by method: see `image_metrics`. ``truth``: ``image_error``, the rms standard
        error of the true image over its rms, below which an nrmse is meaningless. ``spots``, by
        method: for each spot range_m, true_m, error_m, sigma_m, status and alternatives, each with
        range_m, sigma_m and weight; a range without true_m is a false alarm. ``depths``, by method:
        see `depth_metrics`.

    Raises
    ------
    InputError
        If the result is not of this capture, or the truth of its frame is unknown.
    """
    if recording.truth is None:
        raise InputError(
            "the capture contains no truth, only simulated captures do; use `evaluate_recording` "
            "for the noise of repeated frames"
        )
    frame = recording.frame(result.frame)
    if result.recording != frame.digest(recording.setup):
        raise InputError(
            f"the result is not one of frame {result.frame} of this capture: patterns or readings "
            "differ"
        )
    truth = recording.truth.at(result.frame)
    optics = recording.setup.optics
    rays = None if optics is None else pixel_rays(optics, truth.depth_m.shape)
    return {
        "frame": result.frame,
        "images": {
            name: image_metrics(image, truth.image, result.images.get(BASELINE))
            for name, image in result.images.items()
            if recording.plan.shows_image
        },
        "truth": {"image_error": _relative_rms(truth.image_error, truth.image)},
        "spots": {name: _spots(ranges, truth) for name, ranges in result.rangings.items()},
        "depths": {
            name: depth_metrics(
                depth_m,
                truth.depth_m,
                sigma=result.log_depth_sigmas.get(name),
                no_return=result.no_returns.get(name),
                rays=rays,
                free=result.free_probabilities.get(name),
                min_free=result.min_free,
            )
            for name, depth_m in result.depths.items()
        },
    }


def image_metrics(
    image: ArrayLike, true_image: ArrayLike, zero_filled: ArrayLike | None = None
) -> dict[str, float | None]:
    """Correlation, errors and gain of an image.

    Parameters
    ----------
    image, true_image
        Images of one shape; pixels without a finite true value are ignored.
    zero_filled
        Zero-filled inverse, the baseline of the gain.

    Returns
    -------
    dict
        ``correlation`` (Pearson); ``nrmse``, rms error over the truth's rms; ``psnr_db``, with the
        truth's peak; ``gain_db``, mean squared error of the better of two trivial images over that
        of this one, None without ``zero_filled``. Those two are the zero-filled inverse and a flat
        image of the true mean, which wins where noise exceeds the image.
    """
    true_values = np.asarray(true_image, dtype=np.float64)
    finite = np.isfinite(true_values)
    true_values = true_values[finite]
    values = np.asarray(image, dtype=np.float64)[finite]
    with np.errstate(divide="ignore", invalid="ignore"):
        squared_error = np.mean((values - true_values) ** 2)
        baseline = np.nan
        if zero_filled is not None:
            plain = np.asarray(zero_filled, dtype=np.float64)[finite]
            baseline = min(np.mean((plain - true_values) ** 2), true_values.var())
        spread = values.std() * true_values.std()
        covariance = np.mean((values - values.mean()) * (true_values - true_values.mean()))
        return {
            "correlation": number(covariance / spread),
            "nrmse": number(np.sqrt(squared_error / np.mean(true_values**2))),
            "psnr_db": number(10 * np.log10(true_values.max() ** 2 / squared_error)),
            "gain_db": number(10 * np.log10(baseline / squared_error)),
        }


def _relative_rms(error: ArrayLike, image: ArrayLike) -> float | None:
    noise, signal = (np.nanmean(np.asarray(a, dtype=np.float64) ** 2) for a in (error, image))
    return number(np.sqrt(noise / signal)) if signal > 0 else None


def _spots(ranges: Ranges, truth: FrameTruth) -> list[dict[str, Any]]:
    return [
        {
            "range_m": number(measured),
            "true_m": number(true),
            "error_m": number(measured - true),
            "sigma_m": number(sigma),
            "status": status,
            "alternatives": [each._asdict() for each in alternatives],
        }
        for measured, true, sigma, status, alternatives in zip(
            ranges.range_m,
            truth.spot_range_m,
            ranges.sigma_m,
            ranges.status,
            ranges.alternatives,
            strict=True,
        )
    ]
