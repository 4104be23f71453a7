"""The operator as other libraries have theirs: the same products, and their solvers work."""

import sys
from importlib.util import find_spec, module_from_spec
from types import SimpleNamespace

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


class Tensor(np.ndarray):
    """As much of torch's as the adapter uses."""

    device = "cpu"

    def detach(self):
        return self

    cpu = numpy = detach


def test_deepinv_gets_the_operator_and_its_adjoint(monkeypatch):
    """By the names of its functions, wherever DeepInverse itself is missing."""
    torch = SimpleNamespace(
        as_tensor=lambda values, dtype, device: np.asarray(values, dtype).view(Tensor)
    )
    physics = SimpleNamespace(
        LinearPhysics=lambda **given: SimpleNamespace(**given), GaussianNoise=lambda sigma: sigma
    )
    monkeypatch.setitem(sys.modules, "torch", torch)
    monkeypatch.setitem(sys.modules, "deepinv", SimpleNamespace(physics=physics))
    spec = find_spec("reconstruction.adapters.deepinv")
    adapter = module_from_spec(spec)
    spec.loader.exec_module(adapter)
    made = adapter.linear_physics(OPERATOR, 0.5)
    assert (made.noise_model, made.img_size) == (0.5, (1, 16, 16))
    images = np.stack([IMAGE, 2 * IMAGE])[:, None].view(Tensor)
    seen = made.A(images)
    np.testing.assert_allclose(seen, np.stack([VALUES, 2 * VALUES]) / OPERATOR.row_length)
    back = made.A_adjoint(seen)
    assert back.shape == images.shape
    assert np.vdot(back, images) == pytest.approx(np.vdot(seen, seen))


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
