"""What the budget says of an image, against recordings of images that it is said of."""

import numpy as np
import pytest
from scipy.fft import idctn

from instruments import changed
from reconstruction.image.dictionaries.dct import DICTIONARY
from reconstruction.operators import decoder_for, expose, illumination, make_plan
from spisim.budget import Target, bucket_link, budget_warnings, image_budget
from spisim.budget.image import CONTRAST
from spisim.instrument import load_instrument

TARGET = Target(3.0, 0.5, 30.0)
IMAGES = 400
PLANS = {
    "single-ended": {"polarity": "single-ended"},
    "differential": {"polarity": "differential"},
    "product": {"polarity": "differential", "order": "product"},
}


def small(**plan):
    """The paper's instrument with few pixels, and light that makes noise and signal alike."""
    plan = {"patterns": 40, "order": "sequency-2d", **plan}
    return changed("paper", projector__shape=[16, 16], projector__power_w=0.15, plan=plan)


def typical_images(shape, mean, rng):
    """Images (n, H, W) of 1/f² spectrum and the budget's contrast, Gaussian."""
    sigma = DICTIONARY.sigma(shape)
    sigma *= CONTRAST * mean * np.sqrt(np.prod(shape) / np.sum(sigma**2))
    spectra = sigma * rng.standard_normal((IMAGES, *shape))
    return mean + idctn(spectra, axes=(1, 2), norm="ortho")


def recorded(instrument, images, rng):
    """Decoded coefficients (n, K) of images in electrons, noise and converter included."""
    plan = instrument.pattern_plan
    link = bucket_link(instrument, TARGET)
    light = expose(plan, images) + link.daylight_electrons + link.dark_electrons
    readings = instrument.detector.read(light, instrument.exposure_time_s, rng)
    electrons = (readings.counts - readings.offset_counts) * readings.electrons_per_count
    decoder = decoder_for(plan)
    errors = decoder.decode(electrons - light)
    if decoder.shared.any():  # as the reconstruction takes off what all have in common
        columns = decoder.shared_columns()
        errors -= (electrons - light)[:, decoder.shared] @ columns.T
    return decoder.operator, decoder.decode(light), errors


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_signal_and_noise_of_coefficients_are_those_of_recordings(plan):
    instrument = small(**plan)
    budget = image_budget(instrument, TARGET)
    rng = np.random.default_rng(1)
    images = typical_images(instrument.projector.shape, budget.pixel_electrons, rng)
    operator, signal, errors = recorded(instrument, images, rng)
    assert budget.pixel_electrons == pytest.approx(
        float(bucket_link(instrument, TARGET).signal_electrons) / 256
    )
    varying = operator.varying
    variance = budget.coefficient_noise_electrons**2
    assert abs(z_of_power(errors, variance)) < 4
    expected = variance * budget.coefficient_snr**2
    power = np.mean(signal[:, varying] ** 2, axis=1)  # images are independent, rows are not
    assert abs(power.mean() - expected) < 4 * power.std() / np.sqrt(IMAGES)
    noise = operator.min_norm(errors)
    assert abs(z_of_power(noise, budget.pixel_noise_electrons**2)) < 4


def z_of_power(values, variance):
    """Of the mean square of independent images or rows, against what it should be."""
    power = np.mean(np.reshape(values, (IMAGES, -1)) ** 2, axis=1)
    return (power.mean() - variance) / (power.std() / np.sqrt(IMAGES))


def test_correlation_and_frames_are_those_of_recordings():
    instrument = small(polarity="differential")
    budget = image_budget(instrument, TARGET)
    rng = np.random.default_rng(2)
    images = typical_images(instrument.projector.shape, budget.pixel_electrons, rng)
    operator, signal, errors = recorded(instrument, images, rng)
    more = [recorded(instrument, images, rng)[2] for _ in range(3)]
    for frames, noise in ((1, errors), (4, np.mean([errors, *more], axis=0))):
        result = operator.min_norm(signal + noise)
        covariance, power, truth = (
            np.sum((a - a.mean((1, 2), keepdims=True)) * (b - b.mean((1, 2), keepdims=True)))
            for a, b in ((result, images), (result, result), (images, images))
        )
        pooled = covariance / np.sqrt(power * truth)  # over all images: sums, not means of ratios
        assert pooled == pytest.approx(budget.averaged_correlation(frames), abs=0.015)
    wanted = budget.averaged_correlation(4)
    assert budget.frames(wanted - 1e-6) == 4
    assert budget.frames(wanted + 1e-3) == 5
    assert budget.frames(budget.best_correlation) is None


def test_the_mtf_is_what_is_left_of_a_grating():
    plan = make_plan((16, 16), 40)
    instrument = small(polarity="single-ended")
    budget = image_budget(instrument, TARGET)
    operator = decoder_for(plan).operator
    pixel = np.arange(16)
    for cycles in (1, 3, 8):
        left = []
        for phase in np.pi * np.arange(8) / 8:
            wave = np.cos(2 * np.pi * cycles * pixel / 16 + phase)
            for grating in (np.tile(wave, (16, 1)), np.tile(wave[:, None], 16)):
                back = operator.min_norm(operator.forward(grating))
                left.append([np.sum(back * grating), np.sum(grating**2)])
        across, down = (np.array(left)[first::2].sum(axis=0) for first in (0, 1))
        assert budget.across.mtf[cycles - 1] == pytest.approx(across[0] / across[1])
        assert budget.down.mtf[cycles - 1] == pytest.approx(down[0] / down[1])


def test_the_faintest_grating_has_the_signal_over_noise_that_rose_asks_for():
    instrument = small(polarity="differential")
    budget = image_budget(instrument, TARGET)
    x = np.arange(16)
    contrast = budget.across.contrast[1]
    turns = 2 * np.pi * 2 * x / 16
    gratings = [budget.pixel_electrons * contrast * np.cos(turns + p) for p in (0, np.pi / 2)]
    operator = decoder_for(instrument.pattern_plan).operator
    power = np.mean([np.sum(operator.forward(np.tile(g, (16, 1))) ** 2) for g in gratings])
    assert np.sqrt(power) / budget.coefficient_noise_electrons == pytest.approx(5)


def test_all_patterns_see_everything():
    instrument = small(patterns=256, polarity="differential")
    budget = image_budget(instrument, TARGET)
    assert budget.seen == pytest.approx(1)
    assert budget.across.mtf == pytest.approx(np.ones(8))
    assert budget.across.half_cycles == np.inf
    assert illumination(instrument.pattern_plan, 0).min() == 1


def test_who_has_more_noise_than_image_is_told():
    (warning,) = budget_warnings(load_instrument("fga015"), Target(4.0, 0.5, 20.0))
    assert warning.startswith("there is hardly an image at 4 m: signal over noise is 0.63")
    assert "a flat image is nearer to the truth" in warning
    assert "average 11 frames (0.094 s) for a correlation of 0.71" in warning
    assert budget_warnings(load_instrument("paper"), Target(4.0, 0.5, 20.0)) == []


def test_without_light_or_patterns_there_is_no_image_however_many_frames() -> None:
    level = small(patterns=1, polarity="differential")
    for instrument, target in (
        (level, TARGET),
        (small(polarity="differential"), Target(3.0, 0.5, 0, 500)),
    ):
        budget = image_budget(instrument, target)
        assert budget.coefficient_snr == budget.correlation == 0
        assert budget.frames() is None
        assert "averaging more frames does not help" in budget_warnings(instrument, target)[0]
    assert budget.across.contrast.min() == np.inf
