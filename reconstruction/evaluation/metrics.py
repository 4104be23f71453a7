"""How good a result is, against the truth that a simulation knows."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import InputError
from ..capture import Capture, FrameTruth
from ..depth import pixel_rays
from ..ranging import Ranges
from ..result import BASELINE, Result
from .depths import depth_metrics, number


def evaluate(result: Result, recording: Capture) -> dict[str, Any]:
    """Metrics of a result against the truth of its frame, as plain numbers, ready for JSON.

    ``frame``: its number. ``images``, by method: see `image_metrics`. ``truth``: the rms standard
    error of its image over the image's rms, ``image_error``, below which an nrmse tells nothing.
    ``spots``, by method: for each spot range_m, true_m, error_m, sigma_m, status and alternatives,
    each with range_m, sigma_m and weight; a range without true_m is a false alarm. ``depths``, by
    method: see `depth_metrics`. What does not exist is empty or None.

    Raises InputError where the result is of other readings than this capture's frame of the same
    number, and where the truth of that frame is not known.
    """
    if recording.truth is None:
        raise InputError(
            "the capture holds no truth to compare with; simulated captures do (what frames "
            "repeat: `evaluate_recording`)"
        )
    frame = recording.frame(result.frame)
    if result.recording != frame.digest(recording.setup):
        raise InputError(
            f"the result is not one of frame {result.frame} of this capture: patterns or readings "
            "are different"
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
    """Pearson correlation, rms error over the truth's rms, PSNR with the truth's peak, and gain.

    ``gain_db``: mean squared error of the better of two images that know nothing of images over
    that of this one: the ``zero_filled`` inverse, and a flat one as bright as the truth is on
    average, which wins where there is more noise than image. None without the former.
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
