"""Images through patterns and their noise, in closed form.

The image is typical, with the mean of a wall at the target's distance, of `CONTRAST`, and the power
spectrum 1/f² of natural images (D. J. Field, J. Opt. Soc. Am. A 4, 2379 (1987)). Coefficients are
those of rows of unit length: N pixels of mean x̄ and contrast C hold the power N (C x̄)², of which
the patterns sample a fraction S. With the noise ν of each of K coefficients

    SNR of a coefficient = √(S N (C x̄)² / K) / ν
    noise of a pixel of the zero-filled image = ν √(K / N)
    correlation of that image = √S / √(1 + 1 / SNR² + t²)

with the unknown rms throughput t of patterns; below an SNR of 1 a flat image is nearer to the
truth. Averaging F frames multiplies the SNR by √F. Not valid if the DC coefficient, shared by
single-ended readings, is noisier than they are.
"""

from dataclasses import dataclass
from math import ceil

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import naming
from reconstruction.image import Prior
from reconstruction.operators import Decoder, MeasurementOperator, decoder_for, expose
from spisim.budget.link import Target, bucket_link
from spisim.budget.noise import NoiseBudget, bucket_noise, collected_fraction
from spisim.instrument import Instrument

#: Standard deviation over mean: the median of drawn scenes, half of which lie in 0.44 to 0.89.
CONTRAST = 0.67
#: Minimum SNR for reliable detection by eye: A. Rose, J. Opt. Soc. Am. 38, 196 (1948).
DETECTION_SNR = 5.0
#: SNR below which averaging takes longer than any flight.
MIN_SNR = 1e-6
#: MTF that is only rounding.
MIN_MTF = 1e-12
#: Fraction of the noiseless correlation that averaging aims at.
GOAL_FRACTION = 0.9


@dataclass(frozen=True, eq=False)
class Resolution:
    """Response to gratings in one direction.

    `cycles` (F,): periods across the field, up to one in two pixels. `mtf` (F,): fraction of a
    grating's power in the coefficients, averaged over phase, which is the factor of its amplitude
    in the zero-filled image. `contrast` (F,): minimum detectable (max - min) / (max + min) of a
    grating all over the field; above 1 there is none.
    """

    cycles: Floats
    mtf: Floats
    contrast: Floats

    @property
    def half_cycles(self) -> float:
        """Interpolated periods at an MTF of ½: 0 if it is always below, inf if never."""
        below = np.flatnonzero(self.mtf < 0.5)
        if not below.size:
            return np.inf
        end = int(below[0])
        if end == 0:
            return 0.0
        fall = (self.mtf[end - 1] - 0.5) / (self.mtf[end - 1] - self.mtf[end])
        return float(self.cycles[end - 1] + fall * (self.cycles[end] - self.cycles[end - 1]))


@dataclass(frozen=True, eq=False)
class ImageBudget:
    """Image of one frame of one target; electrons are those of an exposure.

    `seen` is the fraction S of a typical image's power that the patterns sample. `across` and
    `down` are gratings that vary along rows and along columns.
    """

    pixel_electrons: float
    coefficient_noise_electrons: float  # as decoded, sum h x
    pixel_noise_electrons: float
    coefficient_snr: float
    seen: float
    across: Resolution
    down: Resolution
    throughput_rms: float = 0.0  # scatter of the patterns' throughput, unless captures state it

    @property
    def pixel_snr(self) -> float:
        """Mean of a pixel over its noise in the zero-filled image."""
        return self.pixel_electrons / self.pixel_noise_electrons

    @property
    def best_correlation(self) -> float:
        """Correlation of the noiseless zero-filled image with a typical truth."""
        return float(np.sqrt(self.seen))

    @property
    def correlation(self) -> float:
        """Correlation with noise."""
        return self.averaged_correlation(1)

    def frames(self, correlation: float | None = None) -> int | None:
        """Frames to average for a correlation, by default nearly the best; None if unattainable."""
        wanted = GOAL_FRACTION * self.best_correlation if correlation is None else correlation
        if wanted >= self.best_correlation or self.coefficient_snr < MIN_SNR:
            return None
        fraction = wanted / self.best_correlation
        left = 1 - fraction**2 * (1 + self.throughput_rms**2)
        return max(ceil(fraction**2 / left / self.coefficient_snr**2), 1) if left > 0 else None

    def averaged_correlation(self, frames: int) -> float:
        """Correlation of the zero-filled mean of some frames."""
        power = frames * self.coefficient_snr**2
        wrong = power * (1 + self.throughput_rms**2)
        return self.best_correlation * float(np.sqrt(power / (1 + wrong)))


def image_budget(instrument: Instrument, target: Target) -> ImageBudget:
    """Image quality of one frame.

    Parameters
    ----------
    instrument : Instrument
        What is budgeted.
    target : Target
        Gives the mean brightness; plain numbers.

    Raises
    ------
    InputError
        If the patterns cannot remove the background.
    """
    plan = instrument.pattern_plan
    link = bucket_link(instrument, target)
    with naming("plan"):
        decoder = decoder_for(plan)
    operator = decoder.operator
    signal = float(link.signal_electrons) * collected_fraction(instrument)
    pixel = (1 - instrument.imaging.projector.dark_level) * signal / plan.pixels
    variance = _coefficient_variance(instrument, decoder, bucket_noise(instrument, link))
    noise = float(np.sqrt(variance.mean())) / operator.row_length
    prior = Prior(operator)
    seen = float(prior.expected.sum() / np.sum(prior.sigma**2))
    power = plan.pixels * (CONTRAST * pixel) ** 2
    across, down = _resolutions(operator, noise / pixel if pixel else np.inf)
    return ImageBudget(
        pixel_electrons=pixel,
        coefficient_noise_electrons=noise * operator.row_length,
        pixel_noise_electrons=noise * float(np.sqrt(operator.shape[0] / plan.pixels)),
        coefficient_snr=float(np.sqrt(seen * power / max(len(prior.expected), 1))) / noise,
        seen=seen,
        across=across,
        down=down,
        throughput_rms=float(np.std(instrument.recorded_plans[0].factors / plan.factors)),
    )


def image_warnings(instrument: Instrument, target: Target) -> list[str]:
    """A warning if there is more noise than image."""
    budget = image_budget(instrument, target)
    if budget.coefficient_snr >= 1:
        return []
    frames = budget.frames()
    advice = "averaging more frames does not help"
    if frames is not None:
        advice = (
            f"average {frames} frames ({frames * instrument.frame_time_s:.2g} s) for a correlation "
            f"of {budget.averaged_correlation(frames):.2f} with the truth"
        )
    return [
        f"there is hardly an image at {float(target.distance_m):g} m: signal over noise is "
        f"{budget.coefficient_snr:.2g} per coefficient ({budget.pixel_electrons:.3g} electrons a "
        f"pixel, {budget.coefficient_noise_electrons:,.0f} of noise a coefficient), so that a flat "
        f"image is nearer to the truth than the zero-filled one; {advice}"
    ]


def _coefficient_variance(instrument: Instrument, decoder: Decoder, all_on: NoiseBudget) -> Floats:
    """Variance (K,) of coefficients, electrons², from that of a reading with all pixels on."""
    plan, dark = instrument.pattern_plan, instrument.imaging.projector.dark_level
    lit = dark * plan.factors + (1 - dark) * expose(plan, np.full(plan.shape, 1 / plan.pixels))
    steady = sum(float(value) for name, value in all_on.variances.items() if name != "signal")
    return decoder.own_variance(float(all_on.variances["signal"]) * lit + steady)


def _resolutions(operator: MeasurementOperator, noise: float) -> tuple[Resolution, Resolution]:
    """Across and down, for coefficient `noise` relative to the mean of a pixel."""
    height, width = operator.image_shape
    seen = operator.in_atoms(_waves(height), _waves(width)).by_atom()
    across, down = (
        _resolution(_phases_together(line), noise, height * width) for line in (seen[0], seen[:, 0])
    )
    return across, down


def _resolution(mtf: Floats, noise: float, pixels: int) -> Resolution:
    with np.errstate(divide="ignore"):
        contrast = np.asarray(DETECTION_SNR * noise / np.sqrt(pixels * mtf / 2), dtype=np.float64)
        contrast[mtf < MIN_MTF] = np.inf
    return Resolution(np.arange(1.0, mtf.size + 1), mtf, contrast)


def _waves(side: int) -> Floats:
    """Orthonormal sinusoids in columns (side, side): constant, cos 1, sin 1, cos 2, ..."""
    turns = 2 * np.pi * np.outer(np.arange(side), np.arange(1, side // 2 + 1)) / side
    both = np.stack([np.cos(turns), np.sin(turns)], axis=-1).reshape(side, -1)[:, : side - 1]
    waves = np.column_stack([np.ones(side), both])
    return np.asarray(waves / np.linalg.norm(waves, axis=0))


def _phases_together(seen: Floats) -> Floats:
    """Power fractions of sinusoids (side,) by frequency: the mean of cosine and sine."""
    cosines, sines = seen[1::2], seen[2::2]
    if sines.size < cosines.size:  # the highest frequency has no sine
        sines = np.append(sines, cosines[-1])
    return np.asarray((cosines + sines) / 2)
