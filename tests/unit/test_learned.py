"""The learned method: its network, what it does with frames unlike all others, and its file."""

import numpy as np
import pytest

from convolutions import convolved, shuffled, unshuffled
from images import correlation, natural_image
from reconstruction.base.errors import InputError
from reconstruction.image import Coefficients, image_method
from reconstruction.image.methods.learned import WEIGHTS, LearnedSolver, shipped
from reconstruction.image.network import FEATURES, VERSION, Network, NetworkInput, load
from reconstruction.operators import decoder_for, make_plan

SNR = 10.0


def displayed(shape, seed=0):
    rng = np.random.default_rng(seed)
    first, better = rng.standard_normal((2, *shape))
    return NetworkInput(first, better, rng.uniform(0.5, 1.0, shape), fraction=0.03, noise=0.2)


@pytest.fixture(scope="module")
def weights():
    with np.load(WEIGHTS, allow_pickle=False) as reported:
        return dict(reported)


def operator_of(shape, patterns):
    return decoder_for(make_plan(shape, patterns, polarity="signed")).operator


def coefficients_of(operator, image, *, snr=SNR, seed=0):
    values = operator.forward(image)
    noise = float(np.std(values[1:])) / snr
    values = values + noise * np.random.default_rng(seed).standard_normal(values.shape)
    return Coefficients(values, np.full(values.shape, noise))


def reference(frame, weights):
    """The network in double precision, channel by channel."""

    def layer(channels, name):
        return convolved(channels, weights, name)

    half = unshuffled(frame.maps().astype(np.float64))
    constant = [np.full(half.shape[1:], number) for number in frame.numbers()]
    retained = np.maximum(layer(np.concatenate([half, constant]), "enter"), 0)
    retained = np.maximum(layer(retained, "before"), 0)
    quarter = np.maximum(layer(unshuffled(retained), "down"), 0)
    for number in (0, 2):
        inner = np.maximum(layer(quarter, f"wide.{number}"), 0)
        quarter = quarter + layer(inner, f"wide.{number + 1}")
    retained = np.maximum(retained + shuffled(layer(quarter, "up")), 0)
    retained = np.maximum(layer(retained, "after"), 0)
    return shuffled(layer(retained, "leave"))


@pytest.mark.parametrize("shape", [(32, 32), (8, 24)])
def test_the_network_is_what_its_definition_says(weights, shape):
    frame = displayed(shape)
    expected = reference(frame, weights)
    assert np.ptp(expected[0]) > 0.01
    np.testing.assert_allclose(shipped()(frame), expected, atol=2e-5, rtol=1e-4)


@pytest.mark.parametrize("shape", [(30, 33), (1, 1), (2, 5)])
def test_images_of_any_sides(shape):
    for result in shipped()(displayed(shape)):
        assert result.shape == shape
        assert np.isfinite(result).all()


def test_the_file_is_small():
    assert WEIGHTS.stat().st_size <= 400_000


@pytest.mark.parametrize("order", ["sequency-2d", "natural", "random:3"])
def test_the_image_agrees_with_readings_without_noise(order):
    image = natural_image(64, 2)
    operator = decoder_for(make_plan(image.shape, 256, order, "signed")).operator
    values = operator.forward(image)
    quiet = Coefficients(values, np.full(len(values), 1e-5 * np.std(values[1:])))
    result = image_method("learned").compile(operator)(quiet)
    misfit = np.abs(operator.forward(result.image) - values).max()
    assert misfit < 1e-3 * np.std(values[1:])


def test_features_do_not_depend_on_the_unit_of_the_image():
    rng = np.random.default_rng(6)
    first, better, sigma = rng.random((3, 8, 8))
    one, other = (
        NetworkInput(k * first, k * better, k * sigma, 0.3, 0.2 * k).features() for k in (1, 7)
    )
    np.testing.assert_allclose(one, other, rtol=1e-5)


def test_what_is_unlike_all_it_learned_from_is_left_as_it_was(weights):
    image = natural_image(32, 1)
    operator = operator_of(image.shape, 64)
    coefficients = coefficients_of(operator, image)
    plain = image_method("edge-preserving").compile(operator)(coefficients)
    usual = image_method("learned").compile(operator)(coefficients)
    assert usual.note is None
    assert np.abs(usual.image - plain.image).max() > 0
    no_return = np.zeros((2, len(FEATURES)))
    solver = image_method("learned").compile(operator)
    strict = LearnedSolver(solver.edges, Network(weights, no_return))
    result = strict(coefficients)
    assert "patterns over pixels = 0.0615, trained for 0 to 0" in result.note
    np.testing.assert_array_equal(result.image, plain.image)
    np.testing.assert_array_equal(result.sigma, plain.sigma)


@pytest.mark.parametrize(("patterns", "snr"), [(1024, 30.0), (8, 30.0)])
def test_shares_of_patterns_that_it_never_saw_are_unlike(patterns, snr):
    image = natural_image(32, 1)
    operator = operator_of(image.shape, patterns)
    result = image_method("learned").compile(operator)(coefficients_of(operator, image, snr=snr))
    assert f"patterns over pixels = {(patterns - 1) / 1024:.3g}, trained for" in result.note


def test_the_deviation_is_the_size_of_the_error():
    squared, expected = 0.0, 0.0
    operator = operator_of((64, 64), 256)
    solve = image_method("learned").compile(operator)
    for seed in range(12):
        image = natural_image(64, 300 + seed)
        result = solve(coefficients_of(operator, image, snr=30, seed=seed))
        squared += float(((result.image - image) ** 2).mean() / image.var())
        expected += float((result.sigma**2).mean() / image.var())
    assert 0.6 < np.sqrt(squared / expected) < 1.6


def test_it_is_never_much_worse_than_what_it_corrects():
    operator = operator_of((64, 64), 128)
    solvers = [image_method(name).compile(operator) for name in ("edge-preserving", "learned")]
    gains = []
    for seed in range(12):
        image = natural_image(64, 400 + seed)
        for snr in (1, 10, 100):
            coefficients = coefficients_of(operator, image, snr=snr, seed=seed)
            plain, learned = (correlation(solve(coefficients).image, image) for solve in solvers)
            gains.append(learned - plain)
    assert min(gains) > -0.03


def test_complex_images_are_left_as_they_are():
    operator = operator_of((16, 16), 64)
    image = natural_image(16, 0) * np.exp(0.3j)
    values = operator.forward(image)
    coefficients = Coefficients(values, np.full(values.shape, 0.01 * np.abs(values).max()))
    plain, learned = (
        image_method(name).compile(operator)(coefficients)
        for name in ("edge-preserving", "learned")
    )
    np.testing.assert_array_equal(plain.image, learned.image)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": np.array(VERSION + 1)}, rf"version of the weights = {VERSION + 1}, must be"),
        ({"version": None}, "version of the weights = None"),
        ({"up.bias": None, "limits": None}, "missing weights limits, up.bias"),
        ({"enter.weight": np.zeros((16, 14))}, r"enter.weight must be finite numbers with 4 axes"),
        ({"enter.bias": np.full(16, np.nan)}, "enter.bias must be finite"),
        ({"enter.bias": np.array(["a"] * 16)}, "enter.bias must be finite"),
    ],
)
def test_weights_that_are_none_are_told(tmp_path, weights, change, said):
    changed = {name: value for name, value in (weights | change).items() if value is not None}
    np.savez(tmp_path / "w.npz", **changed)
    with pytest.raises(InputError, match=said):
        load(tmp_path / "w.npz")


def test_pickles_and_other_files_are_refused(tmp_path, weights):
    np.savez(tmp_path / "w.npz", **(weights | {"up.bias": np.array([{}], dtype=object)}))
    with pytest.raises(InputError, match="contains no network weights"):
        load(tmp_path / "w.npz")
    (tmp_path / "text.npz").write_text("weights")
    with pytest.raises(InputError, match="contains no network weights"):
        load(tmp_path / "text.npz")
    with pytest.raises(InputError, match="contains no network weights"):
        load(tmp_path / "none.npz")
