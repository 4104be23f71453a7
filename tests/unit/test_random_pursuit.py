"""Randomised pursuits: chances by evidence, and a mean that is nearer than any one of them."""

import numpy as np
import pytest

from images import correlation, natural_image
from reconstruction.image import Coefficients, batch_omp, image_method
from reconstruction.image.omp.randomised import drawn, pursue_randomly
from reconstruction.operators import decoder_for, make_plan

SEVERAL = 4000


def problem(rng, *, readings=20, atoms=30, there=3, ridge=0.01):
    """A dictionary, a sparse vector and what noise of variance 1 leaves of it."""
    dictionary = rng.standard_normal((readings, atoms))
    dictionary /= np.linalg.norm(dictionary, axis=0)
    truth = np.zeros(atoms)
    truth[rng.choice(atoms, there, replace=False)] = rng.standard_normal(there) / np.sqrt(ridge)
    return dictionary, truth, dictionary @ truth + rng.standard_normal(readings)


def draws(several, maximum=10, seed=0):
    return np.random.default_rng(seed).random((several, maximum))


def pursue(dictionary, measured, *, ridge=0.01, odds=0.1, of=draws(16)):  # noqa: B008
    gram = dictionary.T @ dictionary
    return pursue_randomly(gram, measured @ dictionary, ridge=ridge, odds=odds, draws=of)


class TestDrawn:
    def test_things_are_drawn_by_their_weights(self):
        weights = np.array([0.5, 2.0, 0.0, 1.5])
        with np.errstate(divide="ignore"):
            result = drawn(np.tile(np.log(weights), (SEVERAL, 1)), draws(SEVERAL)[:, 0])
        chances = np.append(weights, 1.0) / (weights.sum() + 1)
        counts = np.array([(result == each).sum() for each in (0, 1, 2, 3, -1)])
        spread = np.sqrt(SEVERAL * chances * (1 - chances))
        assert (np.abs(counts - SEVERAL * chances) <= 4 * spread).all()

    def test_overwhelming_evidence_does_not_overflow(self):
        assert drawn(np.array([[0.0, 1e5], [-np.inf, -np.inf]]), np.array([0.9, 0.9])).tolist() == [
            1,
            -1,
        ]


@pytest.mark.parametrize("turn", [0, 1j])
def test_coefficients_are_the_means_given_the_atoms(turn):
    rng = np.random.default_rng(1)
    dictionary, _, measured = problem(rng)
    measured = measured + turn * problem(rng)[2]
    result = pursue(dictionary, measured, ridge=0.3)
    assert len({tuple(np.flatnonzero(each)) for each in result}) > 1
    for each in result:
        part = dictionary[:, each != 0]
        normal = part.T @ part + 0.3 * np.eye(part.shape[1])
        np.testing.assert_allclose(each[each != 0], np.linalg.solve(normal, part.T @ measured))


@pytest.mark.parametrize(("measured", "parts"), [(1.7, 0.5), (1.2 + 1.2j, 1.0)])
def test_of_one_atom_the_mean_is_the_posterior_mean(measured, parts):
    """Of a coefficient that is there with odds 1 : 5, closed form."""
    ridge, odds = 0.2, 0.2
    exponent = abs(measured) ** 2 / (1 + ridge) - np.log1p(1 / ridge)
    there = odds * np.exp(parts * exponent)
    chance = there / (1 + there)
    result = pursue(np.eye(1), np.array([measured]), ridge=ridge, odds=odds, of=draws(SEVERAL))[
        :, 0
    ]
    assert np.allclose(result[result != 0], measured / (1 + ridge))
    spread = np.sqrt(chance * (1 - chance) / SEVERAL)
    assert abs(np.mean(result != 0) - chance) < 4 * spread


def test_the_mean_of_many_is_nearer_than_the_greedy_one():
    """M. Elad, I. Yavneh 2009, Fig. 4, by standard errors over problems."""
    gains = []
    for seed in range(100):
        dictionary, truth, measured = problem(np.random.default_rng(100 + seed), ridge=0.1)
        mean = pursue(dictionary, measured, ridge=0.1).mean(axis=0)
        greedy = batch_omp(
            dictionary.T @ dictionary,
            measured @ dictionary,
            measured @ measured,
            ridge=0.1,
            max_atoms=3,
        )
        gains.append(np.sum((greedy - truth) ** 2) - np.sum((mean - truth) ** 2))
    assert np.mean(gains) > 3 * np.std(gains) / np.sqrt(len(gains))


def test_nothing_but_noise_takes_hardly_an_atom():
    measured = np.random.default_rng(3).standard_normal(20)
    dictionary, _, _ = problem(np.random.default_rng(4))
    result = pursue(dictionary, measured, ridge=1e-4, odds=1e-3)
    assert np.mean((result != 0).sum(axis=1)) < 0.5


class TestMethod:
    PATTERNS = 64

    def solver(self, dictionary="learned", patterns=PATTERNS):
        operator = decoder_for(make_plan((32, 32), patterns, polarity="signed")).operator
        return image_method(f"random-pursuit:{dictionary}").compile(operator), operator

    def coefficients(self, operator, image, noise, seed=0):
        values = operator.forward(image)
        values = values + noise * np.random.default_rng(seed).standard_normal(values.shape)
        return Coefficients(values, np.full(values.shape, noise))

    def test_the_same_coefficients_give_the_same_image(self):
        images = []
        for _ in range(2):
            solve, operator = self.solver()
            result = solve(self.coefficients(operator, natural_image(32, 1), 1.0))
            images.append((result.image, result.sigma))
        np.testing.assert_array_equal(*[image for image, _ in images])
        np.testing.assert_array_equal(*[sigma for _, sigma in images])

    def test_an_image_of_few_atoms_is_better_than_by_least_squares(self):
        solve, operator = self.solver("haar")
        linear = image_method("least-squares").compile(operator)
        square = np.zeros((32, 32))
        square[8:16, 16:24] = 1.0
        coefficients = self.coefficients(operator, square, 0.1)
        pursued, plain = (correlation(of(coefficients).image, square) for of in (solve, linear))
        assert pursued > plain + 0.05

    def test_a_complex_image_turns_with_its_phase(self):
        solve, operator = self.solver()
        turn = np.exp(0.7j)
        both = natural_image(32, 3) + 1j * natural_image(32, 4)
        images = []
        for image in (both, both * turn):
            coefficients = Coefficients(operator.forward(image), np.full(self.PATTERNS, 1.0))
            images.append(solve(coefficients).image)
        np.testing.assert_allclose(images[0] * turn, images[1], atol=1e-9)

    def test_coefficients_that_were_not_measured_do_not_count(self):
        solve, operator = self.solver()
        coefficients = self.coefficients(operator, natural_image(32, 2), 1.0)
        noise = coefficients.noise.copy()
        noise[[5, 40]] = np.inf
        images = []
        for lost in (0.0, 1e3):
            values = coefficients.values.copy()
            values[[5, 40]] = lost
            images.append(solve(Coefficients(values, noise)).image)
        np.testing.assert_allclose(images[0], images[1])

    def test_all_patterns_are_left_to_least_squares(self):
        operator = decoder_for(make_plan((64, 64), polarity="signed")).operator
        result, linear = (
            image_method(name).compile(operator) for name in ("random-pursuit", "least-squares")
        )
        assert result is linear
