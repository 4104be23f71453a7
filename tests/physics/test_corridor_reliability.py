"""The probability of a free corridor on families that nothing learned from, in clear air."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spisim
from reconstruction import Reconstructor
from reconstruction.depth import DISTANCES_M, Corridor, nearest_obstacle_m, pixel_rays
from spisim.atmosphere import CLEAR
from spisim.base.config import dump_yaml
from spisim.scene.load import make_scene
from spisim.simulation import simulate

FAMILIES = (
    *("landing-pad", "power-line", "racing-gates", "rubble", "stairwell", "targets", "tunnel"),
    *("bridge", "field", "shipyard"),
)
SEEDS = range(4)


@pytest.fixture(scope="module")
def stated():
    """Probabilities (captures, K), and the true nearest obstacles."""
    instrument = spisim.load_instrument("fog")
    free, true_m, reconstruct = [], [], None
    for family in FAMILIES:
        for seed in SEEDS:
            text = dump_yaml({"family": family, "seed": 1000 + seed})
            scene = make_scene(text, Path(), family, wavelength_nm=instrument.wavelength_nm)
            scene = replace(scene, atmosphere=CLEAR)
            capture = simulate(scene, instrument, light="surrogate", seed=seed).capture
            if reconstruct is None:
                reconstruct = Reconstructor(capture.setup, image="edge-preserving", depth="learned")
                corridor = Corridor(pixel_rays(capture.setup.optics, capture.plan.shape))
            free.append(reconstruct(capture.frame(0)).free_probability)
            true_m.append(corridor.nearest_m(capture.truth.at(0).depth_m.astype(np.float64)))
    return np.array(free), np.array(true_m)


@pytest.mark.slow
def test_what_is_free_is_stated_to_be_as_often(stated):
    free, true_m = stated
    truly = ~(true_m[:, None] <= DISTANCES_M)
    tenth = np.minimum(free * 10, 9).astype(int)
    off = [abs((free - truly)[tenth == n].sum()) for n in range(10)]
    assert sum(off) / free.size < 0.05


@pytest.mark.slow
def test_few_obstacles_are_missed_with_few_false_alarms(stated):
    free, true_m = stated
    missed, false = [], []
    for min_free in np.linspace(0.05, 0.95, 19):
        ratio = np.array([nearest_obstacle_m(each, min_free) for each in free]) / true_m
        missed.append(np.mean(~(ratio[np.isfinite(true_m)] <= 1.25)))
        reported = np.array([np.isfinite(nearest_obstacle_m(each, min_free)) for each in free])
        false.append(np.mean(reported & ~(ratio >= 0.75)))
    assert min(f for f, m in zip(false, missed, strict=True) if m <= 0.05) <= 0.20
