"""Gaussian images from coefficients whose noise is of many sizes, against the closed form."""

import numpy as np

from images import natural_image
from reconstruction import make_plan
from reconstruction.image import Coefficients
from reconstruction.image.methods.least_squares import METHOD
from reconstruction.operators import decoder_for

OPERATOR = decoder_for(make_plan((16, 16), 90, polarity="signed")).operator
SOLVER = METHOD.compile(OPERATOR)
FIELD = SOLVER.model.field


def posterior(noise):
    values = OPERATOR.forward(natural_image(16, 3))
    values = values + np.random.default_rng(0).normal(size=90) * np.nan_to_num(noise, posinf=0)
    coefficients = Coefficients(np.where(np.isfinite(noise), values, 0), noise)
    return SOLVER.posterior(coefficients), *SOLVER.varying(coefficients)


def closed_form(contrast, measured, noise):
    """Mean (N,) and covariance (N, N) of the posterior's spectrum."""
    finite = np.isfinite(noise)
    rows = SOLVER.model.rows[finite]
    prior = contrast * np.diag(FIELD.variance.ravel())
    gain = prior @ rows.T @ np.linalg.inv(rows @ prior @ rows.T + np.diag(noise[finite] ** 2))
    return gain @ measured[finite], prior - gain @ rows @ prior


def sizes(seed=1):
    return np.exp(np.random.default_rng(seed).normal(1, 1, 90))


def test_the_mean_and_the_covariance_are_those_of_the_closed_form():
    noise = sizes()
    noise[5:20] = np.inf
    result, measured, length_1 = posterior(noise)
    mean, covariance = closed_form(result.contrast, measured, length_1)
    np.testing.assert_allclose(result.mean.ravel(), mean, atol=1e-9 * np.abs(mean).max())
    image = natural_image(16, 4)
    np.testing.assert_allclose(
        result.covariance(image).ravel(),
        covariance @ image.ravel(),
        atol=1e-9 * np.abs(covariance).max() * image.size,
    )


def test_variance_is_that_of_pixels_nearby():
    result, measured, length_1 = posterior(sizes())
    _, covariance = closed_form(result.contrast, measured, length_1)
    atoms = FIELD.image(np.eye(256).reshape(256, 16, 16)).reshape(256, 256)
    exact = np.diag(atoms.T @ covariance @ atoms).reshape(16, 16)
    ratio = np.sqrt(result.variance / exact)
    assert abs(ratio.mean() - 1) < 0.05
    assert ratio.std() < 0.15
    assert (np.isclose(result.variance, exact).sum()) >= 16  # those that were asked


def test_noise_that_is_hardly_uneven_makes_hardly_a_difference():
    even, *_ = posterior(np.full(90, 2.0))
    uneven, *_ = posterior(2.0 + np.linspace(0, 1e-3, 90))
    assert type(even) is not type(uneven)
    assert abs(np.log(uneven.contrast / even.contrast)) < 0.3
    true = natural_image(16, 3) - natural_image(16, 3).mean()
    errors = [np.mean((FIELD.image(each.mean) - true) ** 2) for each in (uneven, even)]
    assert abs(10 * np.log10(errors[0] / errors[1])) < 0.1
