"""Causes of differences of two recordings, and the errors that they are held against."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.stats import chi2, kstest

from sameplane import recorded
from spisim.base.config import dump_yaml
from spisim_compare.causes import FACTOR, Cause, Causes
from spisim_compare.gaussian import Covariance, least_squares
from spisim_compare.judging import ALARM, PATTERNS, SPOTS, Difference, judge
from spisim_compare.light_error import UNSTATED, UNSTATED_OF_SPOT, _dark, with_light_error
from spisim_compare.midpoint import Midpoint
from spisim_compare.noise import _total
from spisim_compare.patterns import Mean


class TestCovariance:
    def test_equals_the_dense_one(self):
        rng = np.random.default_rng(0)
        variance, factors = rng.uniform(1, 2, 9), rng.normal(size=(9, 3))
        noise = Covariance(variance, factors)
        dense = np.diag(variance) + factors @ factors.T
        columns = rng.normal(size=(9, 2))
        np.testing.assert_allclose(noise.solve(columns), np.linalg.solve(dense, columns))
        np.testing.assert_allclose(noise.log_determinant, np.linalg.slogdet(dense)[1])
        np.testing.assert_allclose(noise.total, np.diag(dense))
        white = noise.whiten(columns)
        np.testing.assert_allclose(white.T @ white, columns.T @ np.linalg.solve(dense, columns))

    def test_fit_has_the_stated_errors(self):
        rng = np.random.default_rng(1)
        noise = Covariance(np.full(20, 4.0), np.ones((20, 1)))
        directions = rng.normal(size=(20, 2))
        root = np.linalg.cholesky(np.diag(noise.variance) + noise.factors @ noise.factors.T)
        draws = [least_squares(root @ rng.normal(size=20), directions, noise) for _ in range(2000)]
        theta = np.array([fit.theta for fit in draws])
        np.testing.assert_allclose(np.cov(theta.T), draws[0].covariance, atol=0.02)
        assert kstest([fit.chi_squared for fit in draws], chi2(18).cdf).pvalue > 1e-3


def causes_of(n: int) -> list[Cause]:
    empty = np.zeros((n, 0))
    slope = np.linspace(1, 3, n)[:, None]
    wave = np.sin(np.linspace(0, 20, n))[:, None]
    return [
        Cause("power", "power", (FACTOR,), slope, empty),
        Cause("offset", "offset", ("electrons",), np.ones((n, 1)), empty),
        Cause("pointing", "pointing", ("down_deg",), wave, empty, 0.3),
    ]


class TestJudging:
    def test_false_alarms_are_as_rare_as_promised(self):
        rng = np.random.default_rng(2)
        n, pairs = 100, 1000
        noise = Covariance(np.ones(n), np.full((n, 1), 0.5))
        causes = causes_of(n)
        draws = rng.normal(size=(pairs, n)) + 0.5 * rng.normal(size=(pairs, 1))
        alarms = sum(judge(Difference(each, noise, n), causes).alarm for each in draws)
        assert alarms <= ALARM * pairs + 3 * np.sqrt(ALARM * pairs)

    @pytest.mark.parametrize("number", range(3))
    def test_the_right_cause_is_named(self, number):
        rng = np.random.default_rng(3)
        n = 200
        causes = causes_of(n)
        noise = Covariance(np.ones(n), np.zeros((n, 0)))
        change = 0.7 * causes[number].directions[:, 0]
        verdict = judge(Difference(change + rng.normal(size=n), noise, n), causes)
        assert verdict.explained[0].cause is causes[number]
        value, sigma = verdict.explained[0].theta[0], verdict.explained[0].sigma[0]
        assert abs(value - 0.7) < 4 * sigma

    def test_two_causes_are_told_apart(self):
        rng = np.random.default_rng(4)
        n = 200
        causes = causes_of(n)
        noise = Covariance(np.ones(n), np.zeros((n, 0)))
        change = sum(each.directions[:, 0] for each in causes[1:])
        verdict = judge(Difference(change + rng.normal(size=n), noise, n), causes)
        assert {each.cause.name for each in verdict.explained} == {"offset", "pointing"}

    def test_what_no_cause_explains_stays_unexplained(self):
        rng = np.random.default_rng(5)
        n = 200
        noise = Covariance(np.ones(n), np.zeros((n, 0)))
        verdict = judge(Difference(2 * rng.normal(size=n), noise, n), causes_of(n))
        assert verdict.alarm
        assert verdict.rest < 1e-3

    def test_few_readings_of_spots_do_not_drown_in_those_of_patterns(self):
        rng = np.random.default_rng(6)
        n, patterns = 2000, 1990
        values = rng.normal(size=n)
        values[patterns:] = 2.5
        noise = Covariance(np.ones(n), np.zeros((n, 0)))
        verdict = judge(Difference(values, noise, patterns), causes_of(n))
        assert verdict.probabilities["all readings"] > ALARM
        assert verdict.probabilities[SPOTS] < 1e-3
        assert verdict.probabilities[PATTERNS] > ALARM
        assert verdict.alarm
        assert SPOTS not in judge(Difference(values, noise, n), causes_of(n)).probabilities

    @pytest.mark.parametrize("likelier", ["power", "offset"])
    def test_of_equal_explanations_the_likelier_is_named(self, likelier):
        n = 50
        noise = Covariance(np.full(n, 1e-2), np.zeros((n, 0)))
        both = causes_of(n)[1].directions
        causes = [
            Cause(name, name, ("electrons",), both, np.zeros((n, 0)), odds=1 + (name == likelier))
            for name in ("power", "offset")
        ]
        verdict = judge(Difference(both[:, 0], noise, n), causes)
        assert verdict.explained[0].cause.name == likelier

    def test_a_change_known_badly_leaves_as_much_open(self):
        """What a cause leaves open grows with the error of its size, too."""
        rng = np.random.default_rng(7)
        n, patterns = 60, 50
        seen, elsewhere = np.zeros((2, n, 1))
        seen[:patterns, 0] = 0.1 * rng.normal(size=patterns)
        elsewhere[patterns:, 0] = 10 * rng.normal(size=n - patterns)
        cause = Cause("pointing", "pointing", ("deg",), seen, elsewhere)
        noise = Covariance(np.ones(n), np.zeros((n, 0)))
        values = rng.normal(size=n) + elsewhere[:, 0]
        verdict = judge(Difference(values, noise, patterns), [cause])
        assert [each.cause.name for each in verdict.explained] == ["pointing"]

    def test_a_power_cannot_be_negative(self):
        n = 50
        noise = Covariance(np.full(n, 1e-2), np.zeros((n, 0)))
        causes = causes_of(n)[:1]
        verdict = judge(Difference(-3 * causes[0].directions[:, 0], noise, n), causes)
        assert not verdict.explained


class TestErrorOfLight:
    def test_no_simulation_is_trusted_to_the_last_digit(self):
        """Without any stated error, powers are known no better than what rare paths add."""
        exact = replace(
            recorded(1), truth=None, provenance=replace(recorded(1).provenance, settings="")
        )
        midpoint = Midpoint.of(exact, exact)
        n = midpoint.patterns.size
        n += midpoint.spots.echo.size
        nothing = Covariance(np.full(n, 1e-3), np.zeros((n, 0)))
        noise = with_light_error(nothing, exact, midpoint)
        causes = {each.name: each for each in Causes(midpoint)()}
        for name, error in (("projector power", UNSTATED), ("laser power", UNSTATED_OF_SPOT / 2)):
            fit = least_squares(np.zeros(n), causes[name].directions, noise)
            assert np.sqrt(fit.covariance[0, 0]) == pytest.approx(error, rel=0.2)
        measured = replace(exact, provenance=replace(exact.provenance, source="hardware"))
        assert with_light_error(nothing, measured, midpoint) is nothing

    @pytest.mark.parametrize("method", ["paper", "fog-spad"])
    def test_dark_current_is_no_error_of_daylight(self, method):
        """Steady light of spots counts as uncertain but for what the detector adds in the dark."""
        capture = recorded(1, method)
        fields = yaml.safe_load(capture.provenance.instrument)
        sensor = fields["tof"]["detector"]["sensor"]
        name = "dark_count_rate_hz" if method == "fog-spad" else "dark_current_na"
        sensor[name] *= 3
        fields["detector"]["sensor"]["dark_current_na"] *= 2
        text = dump_yaml(fields)
        more = replace(capture, provenance=replace(capture.provenance, instrument=text))
        (of_pattern, one), (of_two, three) = (_dark(each) for each in (capture, more))
        assert of_pattern > 0
        assert of_two == pytest.approx(2 * of_pattern)
        assert one.shape == (4,)
        assert (one > 0).all()
        np.testing.assert_allclose(three, 3 * one, rtol=1e-3)

    def test_a_spot_is_as_sure_as_its_own_light(self):
        """Errors of spots divide the stated mean square among them."""
        capture = recorded(1)
        settings = yaml.safe_load(capture.provenance.settings)
        errors = np.array(settings["light"]["spot_errors"])
        assert errors.shape == (4,)
        assert (errors > 0).all()
        variances = [self.of_spots(capture, settings, each) for each in (errors, [0, 0, 0, 1e-9])]
        share = settings["light"]["spot_noise_share"] ** 2
        for variance in variances:
            assert variance.mean() == pytest.approx(share, rel=0.05)
        np.testing.assert_allclose(variances[1][:3], 0, atol=1e-9)
        order = np.argsort(variances[0] * self.noise(capture))
        np.testing.assert_array_equal(order, np.argsort(errors))
        without = self.of_spots(capture, settings, None)
        np.testing.assert_allclose(without, share)

    @staticmethod
    def noise(capture) -> np.ndarray:
        mean = Midpoint.of(capture, capture).spots.means[0]
        return (mean.variance * mean.frames).reshape(4, -1).mean(axis=1)

    @staticmethod
    def of_spots(capture, settings, errors) -> np.ndarray:
        """Variance of the light of each spot (4,) over that of its noise."""
        light = {
            **settings["light"],
            "spot_errors": errors if errors is None else [*map(float, errors)],
        }
        text = yaml.safe_dump({**settings, "light": light})
        capture = replace(capture, provenance=replace(capture.provenance, settings=text))
        midpoint = Midpoint.of(capture, capture)
        n = midpoint.patterns.size + midpoint.spots.echo.size
        noise = with_light_error(Covariance(np.zeros(n), np.zeros((n, 0))), capture, midpoint)
        mean = midpoint.spots.means[0]
        of_spots = noise.variance[midpoint.patterns.size :] / (mean.variance * mean.frames)
        return of_spots.reshape(4, -1).mean(axis=1)

    @pytest.mark.parametrize("method", ["paper", "fog-spad"])
    def test_echoes_of_spots_add_up(self, method):
        spots = Midpoint.of(recorded(1, method), recorded(2, method)).spots
        np.testing.assert_allclose(spots.echo_of_spots.sum(axis=1), spots.echo)
        assert (np.count_nonzero(spots.echo_of_spots, axis=1) <= 1).all()


def test_the_error_of_a_noise_ratio_is_that_of_its_degrees_of_freedom():
    """Variances of 100 readings of 9 frames each, four times as large as stated."""
    frames, scatter = np.full(100, 9), np.full(100, 4.0)
    mean = Mean(np.ones(100), np.ones(100), np.ones(100, bool), frames, scatter)
    (term,) = _total("REAL", "readings of spots", mean)
    assert (term.ratio, term.sigma) == pytest.approx((4.0, 4.0 * np.sqrt(2 / 800)))
