"""Scene to depth map through the public interface: exactness, repeatability, and what must win."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c

import reconstruction
import spisim
from spisim.atmosphere import CLEAR
from spisim.instrument import Instrument
from spisim.scene import Scene


@pytest.fixture(scope="module")
def warehouse() -> Scene:
    return spisim.load_scene("warehouse")


@pytest.fixture(scope="module")
def paper() -> Instrument:
    return spisim.load_instrument("paper")


def with_plan(instrument, **changes):
    return instrument.model_copy(update={"plan": instrument.plan.model_copy(update=changes)})


def digest(capture, path):
    stamped = replace(capture.provenance, created="")
    reconstruction.write_capture(replace(capture, provenance=stamped), path)
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("polarity", ["single-ended", "differential"])
def test_full_basis_without_noise_gives_the_transport_image(warehouse, paper, polarity):
    full = with_plan(paper, patterns=4096, polarity=polarity)
    clear = replace(warehouse, atmosphere=CLEAR)
    simulation = spisim.simulate(clear, full, spp=4, noise=False)
    result = reconstruction.reconstruct(simulation.capture)
    transport = simulation.transport.image
    scale = np.sum(transport * result.image) / np.sum(transport**2)
    peak = transport.max()
    assert np.abs(result.image / scale - transport).max() < 2e-6 * peak
    assert np.abs(result.images["zero-filled"] / scale - transport).max() < 2e-6 * peak
    truth = simulation.capture.truth.at(0).image
    np.testing.assert_allclose(result.image, truth, rtol=0, atol=2e-6 * truth.max())


def test_clear_air_spots_are_unbiased(warehouse, paper):
    """Below 1 cm from 3 to 5 m: what is left is light that reaches the spot by other walls."""
    clear = replace(warehouse, atmosphere=CLEAR)
    simulation = spisim.simulate(clear, paper, spp=16, noise=False)
    measured = reconstruction.reconstruct(simulation.capture, weather="clear").ranges.range_m
    true = simulation.truths[0].spot_range_m
    assert np.sum((true > 2.8) & (true < 5.2)) == 3
    np.testing.assert_allclose(measured, true, rtol=0, atol=0.01)


def test_fog_pulls_near_spots_closer_and_pushes_far_ones_away(warehouse, paper):
    """Echo from the fog before the target adds a phasor close to zero path."""
    simulation = spisim.simulate(warehouse, paper, spp=16, noise=False)
    error = (
        reconstruction.reconstruct(simulation.capture, weather="clear").ranges.range_m
        - simulation.truths[0].spot_range_m
    )
    quarter = c / (4 * paper.tof.modulation.frequencies_hz[0])  # half the unambiguous range
    near = simulation.truths[0].spot_range_m < 0.9 * quarter
    far = simulation.truths[0].spot_range_m > 1.2 * quarter
    assert near.any()
    assert far.any()
    assert np.all(error[near] < -0.005)
    assert np.all(error[far] > 0.005)


def test_equal_seeds_give_equal_files_and_different_seeds_do_not(warehouse, paper, tmp_path):
    def capture(seed):
        return spisim.simulate(warehouse, paper, spp=4, seed=seed, frames=2).capture

    digests = [digest(capture(seed), tmp_path / f"{k}.h5") for k, seed in enumerate((7, 7, 8))]
    assert digests[0] == digests[1]
    assert digests[0] != digests[2]


@pytest.mark.parametrize("seed", range(3))
def test_reconstruction_beats_its_baselines(warehouse, paper, seed):
    simulation = spisim.simulate(warehouse, paper, spp=8, seed=seed)
    result = reconstruction.reconstruct(simulation.capture)
    metrics = reconstruction.evaluate(result, simulation.capture)
    images, depths = metrics["images"], metrics["depths"]
    assert images["pursuit"]["correlation"] > images["zero-filled"]["correlation"]
    anchored, nearest = depths["anchored"], depths["nearest"]
    assert anchored["mae_m"] < 0.8 * nearest["mae_m"]
    assert anchored["rmse_m"] < 0.8 * nearest["rmse_m"]
    assert anchored["within_25_percent"] > nearest["within_25_percent"]
