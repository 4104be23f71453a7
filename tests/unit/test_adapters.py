"""The operator as other libraries have theirs: the same products, and their solvers work."""

import numpy as np
import pytest

from images import natural_image
from reconstruction.operators import decoder_for, make_plan

IMAGE = natural_image(16, 0)
OPERATOR = decoder_for(make_plan((16, 16), 100, polarity="signed")).operator
VALUES = OPERATOR.forward(IMAGE)


def test_pylops_inverts_it():
    pylops = pytest.importorskip("pylops")
    from reconstruction.adapters.pylops import linear_operator

    operator = linear_operator(OPERATOR)
    pylops.utils.dottest(operator, 100, 256)
    np.testing.assert_allclose(operator @ IMAGE.ravel(), VALUES)
    result = pylops.optimization.leastsquares.regularized_inversion(
        operator, VALUES, [], iter_lim=50
    )[0]
    np.testing.assert_allclose(result.reshape(16, 16), OPERATOR.min_norm(VALUES), atol=1e-8)


def test_deepinv_inverts_it():
    pytest.importorskip("deepinv")
    import torch

    from reconstruction.adapters.deepinv import linear_physics

    physics = linear_physics(OPERATOR)
    image = torch.as_tensor(IMAGE)[None, None]
    coefficients = physics.A(image)
    np.testing.assert_allclose(coefficients[0].numpy() * OPERATOR.row_length, VALUES)
    assert float(physics.adjointness_test(image)) == pytest.approx(0, abs=1e-8)
    result = physics.A_dagger(coefficients)[0, 0].numpy()
    np.testing.assert_allclose(result, OPERATOR.min_norm(VALUES), atol=1e-3)


def test_spyrit_inverts_it():
    pytest.importorskip("spyrit")
    import torch
    from spyrit.core.inverse import PseudoInverse, Tikhonov

    from reconstruction.adapters.spyrit import linear

    measure = linear(OPERATOR)
    image = torch.as_tensor(IMAGE, dtype=torch.float32)[None, None]
    coefficients = measure(image)
    scaled = coefficients[0, 0].numpy() * OPERATOR.row_length
    np.testing.assert_allclose(scaled, VALUES, atol=1e-4 * VALUES.max())
    minimum = OPERATOR.min_norm(VALUES)
    np.testing.assert_allclose(PseudoInverse(measure)(coefficients)[0, 0], minimum, atol=1e-4)
    white = Tikhonov(measure, torch.eye(256))(coefficients, torch.eye(100))[0, 0]
    np.testing.assert_allclose(white, minimum / 2, atol=1e-4)
    noisy = linear(OPERATOR, noise=0.5)(torch.zeros(50, 16, 16))
    assert noisy.std() == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(2 * 5000))
