"""What trains the network of depths: the same network, in PyTorch and as an ONNX graph."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import depth_network  # noqa: E402
from reconstruction.depth.network import FEATURES, DepthNetwork  # noqa: E402
from reconstruction.depth.network_input import MAPS, NUMBERS, Inputs  # noqa: E402

SHAPE = 16, 24


@pytest.fixture(scope="module")
def net():
    torch.manual_seed(1)
    net = depth_network.Net()
    torch.nn.init.normal_(net.leave.weight, std=0.1)
    return net.eval()


@pytest.fixture(scope="module")
def inputs():
    rng = np.random.default_rng(0)
    maps = rng.standard_normal((MAPS, *SHAPE)).astype(np.float32)
    numbers = rng.standard_normal(len(NUMBERS)).astype(np.float32)
    start = np.zeros(SHAPE, np.float32)
    return Inputs(maps, numbers, start, start + 1)


def evaluated(net, inputs):
    with torch.no_grad():
        return net(torch.from_numpy(inputs.maps[None]), torch.from_numpy(inputs.numbers[None]))[0]


def test_numpy_evaluates_what_was_trained(net, inputs):
    weights = {name: value.numpy() for name, value in net.state_dict().items()}
    limits = np.zeros((2, len(FEATURES)), np.float32)
    reported = DepthNetwork(weights | {"limits": limits, "calibration": np.zeros(1)})(inputs)
    change, log_sigma, logit, trust = evaluated(net, inputs).numpy()
    np.testing.assert_allclose(reported.log_depth, change + 1 / (1 + np.exp(-trust)), atol=1e-4)
    np.testing.assert_allclose(np.log(reported.sigma), np.clip(log_sigma, -4.5, 1), atol=1e-4)
    np.testing.assert_allclose(reported.no_return, 1 / (1 + np.exp(-logit)), atol=1e-4)


def test_the_graph_is_the_network(net, inputs, tmp_path):
    onnx = pytest.importorskip("onnx")
    from onnx.reference import ReferenceEvaluator

    depth_network.export(net, tmp_path / "learned.onnx")
    graph = onnx.load(tmp_path / "learned.onnx")
    onnx.checker.check_model(graph)
    given = {"maps": inputs.maps[None], "numbers": inputs.numbers[None]}
    (result,) = ReferenceEvaluator(graph).run(None, given)
    np.testing.assert_allclose(result[0], evaluated(net, inputs).numpy(), atol=1e-4)


def test_the_loss_is_least_at_the_truth_and_at_the_deviation_of_the_errors():
    torch.manual_seed(2)
    log_depth = torch.full((1, 64, 64), 1.0)
    noise = torch.distributions.Laplace(0.0, 0.1).sample((1, 64, 64))
    start = torch.stack([log_depth + noise] * 2, dim=1)

    def loss(shift=0.0, sigma=0.141):
        out = torch.zeros(1, 4, 64, 64)
        out[:, 0], out[:, 1], out[:, 2] = shift, np.log(sigma), -9.0
        return float(depth_network.loss_of(out, start, log_depth)[0])

    assert loss() < min(loss(shift=0.05), loss(shift=-0.05))
    assert loss() < min(loss(sigma=0.1), loss(sigma=0.2))


def test_what_is_nothing_counts_for_its_probability_alone():
    log_depth = torch.full((1, 8, 8), float("nan"))
    wild, tame = torch.full((1, 4, 8, 8), 5.0), torch.zeros(1, 4, 8, 8)
    wild[:, 2] = tame[:, 2] = 3.0
    losses = [
        depth_network.loss_of(out, torch.zeros(1, 8, 8), log_depth)[0] for out in (wild, tame)
    ]
    assert losses[0] == losses[1]
    assert losses[0] == pytest.approx(np.log1p(np.exp(-3.0)))
