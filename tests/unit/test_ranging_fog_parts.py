"""Parts of ranging in fog against closed forms: what is held of the fog, and the modes."""

import numpy as np
import pytest

from fogs import light
from reconstruction.ranging import Alternative
from reconstruction.ranging.brightness import bucket_optics
from reconstruction.ranging.fog.answer import _status
from reconstruction.ranging.fog.edges import odd_spots
from reconstruction.ranging.fog.fog_state import CHANGE, DRIFT, FogState
from reconstruction.ranging.fog.modes import find_modes
from reconstruction.ranging.fog.numerics import cholesky, whitened
from reconstruction.ranging.fog.overlap import overlap, path_lengths
from reconstruction.ranging.fog.posterior import Posterior, SpotPosterior
from reconstruction.ranging.fog.roots import RootTables
from reconstruction.ranging.fog.templates import STEP_M, Templates
from reconstruction.ranging.fog.underdetermined import ASIDES, GAINS, _likelihood_of_pixel
from spisim.instrument import load_instrument
from spisim.simulation.measurement import recorded_optics

RANGE_M = 0.01 + STEP_M * np.arange(800)


def test_frames_without_any_possible_target_have_no_likelihood_of_pixels() -> None:
    none = np.zeros(0)
    assert _likelihood_of_pixel(none, none, none, none).shape == (GAINS.size * ASIDES.size, 0)


def test_a_frame_later_the_fog_is_a_mixture_of_what_drifted_and_of_another() -> None:
    """Mean and variance of the mixture, by its two parts: how far apart they are is part of it."""
    fraction, prior_fraction = np.array([0.7, 0.3]), np.array([0.2, 0.8])
    last = FogState(fraction, np.array([0.0, 1.0]), np.array([0.1, 0.2]))
    prior = FogState(prior_fraction, np.array([3.0, -2.0]), np.array([0.6, 0.6]))
    following = last.predict(prior)
    weights = np.stack([(1 - CHANGE) * fraction, CHANGE * prior_fraction])
    weights /= weights.sum(axis=0)
    mean = np.stack([last.log_median, prior.log_median])
    variance = np.stack([last.log_sigma**2 + DRIFT**2, prior.log_sigma**2])
    expected = (weights * mean).sum(axis=0)
    squares = (weights * (variance + mean**2)).sum(axis=0)
    np.testing.assert_allclose(following.log_median, expected)
    np.testing.assert_allclose(following.log_sigma, np.sqrt(squares - expected**2))


def test_whitened_vectors_have_the_chi_squared_of_their_covariance() -> None:
    rng = np.random.default_rng(0)
    roots, vectors = rng.normal(size=(50, 6, 6)), rng.normal(size=(50, 6, 3))
    covariance = roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(6)
    lower = cholesky(covariance)
    expected = np.einsum("cij,cij->cj", vectors, np.linalg.solve(covariance, vectors))
    white = whitened(lower, np.ascontiguousarray(vectors.transpose(1, 2, 0)))
    np.testing.assert_allclose((white**2).sum(axis=0).T, expected)
    logs = 2 * np.log(np.diagonal(lower)).sum(axis=1)
    np.testing.assert_allclose(logs, np.linalg.slogdet(covariance)[1])


def templates() -> Templates:
    """Phasors of two frequencies, and fog whose echo grows with the range by pi of the target's.

    A Lambertian target of reflectance 1 sends 1 / pi back per steradian, fog its backscattering.
    """
    phases = 2 * np.pi * RANGE_M[None] / np.array([[20.0], [7.0]])
    reported = np.concatenate([np.cos(phases), np.sin(phases)])  # (4 readings, R)
    target = 1e4 / RANGE_M**2 * reported
    fog = np.pi * np.cumsum(target, axis=-1) * STEP_M
    whole = (4, 2, 4, RANGE_M.size)
    return Templates(
        range_m=RANGE_M,
        extinction_per_m=np.array([0.02, 0.03]),
        target=np.broadcast_to(target, whole).copy(),
        fog=np.broadcast_to(fog, whole).copy(),
        uneven=np.zeros((4, 2, RANGE_M.size // 25 + 1, 4, 4)),
        unambiguous_m=float(RANGE_M[-1]),
    )


def test_the_range_of_a_mode_has_the_variance_of_its_linear_model() -> None:
    """Cramér and Rao, of derivatives by differences: a target farther off has more fog before it,
    which moves readings, too."""
    tables, rho, beta = templates(), 0.3, 0.1
    position = 500

    def model(at: int, reflectance: float, scattering: float) -> np.ndarray:
        return reflectance * tables.target[0, 0, :, at] + scattering * tables.fog[0, 0, :, at]

    along = (model(position + 1, rho, beta) - model(position - 1, rho, beta)) / (2 * STEP_M)
    jacobian = np.stack(
        [along, tables.target[0, 0, :, position], tables.fog[0, 0, :, position]], axis=1
    )
    information = jacobian.T @ jacobian
    inner = np.linalg.inv(information[:2, :2])
    readings = np.tile(model(position, rho, beta), (4, 1))
    covariance = np.tile(np.eye(4), (4, 1, 1))
    result = find_modes(tables, readings, covariance, np.ones(4, dtype=bool), False)
    near = result.only(np.abs(result.range_m - RANGE_M[position]) < 0.005)
    assert near.spot.size > 0
    np.testing.assert_allclose(near.backscatter, beta, rtol=0.02)
    np.testing.assert_allclose(near.variance_m2, inner[0, 0], rtol=0.03)
    np.testing.assert_allclose(near.drift, -(inner @ information[:2, 2])[0], rtol=0.03)
    left = information[2, 2] - information[2, :2] @ inner @ information[:2, 2]
    assert near.curvature == pytest.approx(np.full(near.spot.size, left), rel=0.03)


@pytest.mark.parametrize(("misfit", "odd"), [(8.0, False), (13.0, True)])
def test_three_readings_of_a_spot_leave_one_to_judge_it_by(misfit: float, odd: bool) -> None:
    """Range and reflectance take two. Chance gives 10.8 or more once in a thousand times of one."""
    spot = SpotPosterior(alternatives=(Alternative(3.0, 0.01, 1.0),), misfit=misfit)
    given = Posterior((spot,) * 4, FogState(*(np.ones(1),) * 3))
    assert odd_spots(given, 3) == (list(range(4)) if odd else [])


@pytest.mark.parametrize(("echoes", "status"), [(1, "ambiguous"), (2, "ok")])
def test_a_likely_range_is_ambiguous_unless_the_other_is_an_echo_of_its_own(
    echoes: int, status: str
) -> None:
    alternatives = (Alternative(5.0, 0.01, 0.6), Alternative(8.0, 0.01, 0.4))
    spot = SpotPosterior(alternatives, target=1.0, strength=100.0, echoes=echoes)
    assert _status(spot, guessed=False) == status


def test_a_pixel_of_the_image_gets_what_the_detector_collects() -> None:
    """Fog along its ray, of unit backscattering: pixel_electrons times the integral of overlap."""
    paper = load_instrument("paper")
    optics = recorded_optics(paper)
    spots = paper.tof.record(light(paper, np.full(4, 4.0)), paper.spot_optics, None)
    sigma = np.array([0.01, 0.1])
    tables = RootTables(
        spots, optics, lambda path: np.stack([np.cos(path), np.sin(path)]), 8.0, sigma
    )
    (seen,) = bucket_optics(optics, spots)
    weight, path_m = overlap(seen, tables.range_m)[0], path_lengths(seen, tables.range_m)
    thin, thick = (
        optics.pixel_electrons * np.trapezoid(weight * np.exp(-each * path_m), tables.range_m)
        for each in sigma
    )
    np.testing.assert_allclose(tables.empty_pixel, np.transpose([thin, thick]), rtol=0.02)
