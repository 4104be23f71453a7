"""A range of every pixel from time of flight of every pattern: exact where it can be."""

import numpy as np
import pytest
from scipy.constants import c

from images import natural_image
from reconstruction import make_plan
from reconstruction.capture import Optics
from reconstruction.depth import pixel_rays
from reconstruction.patterns import expose
from reconstruction.ranging import dense_range
from reconstruction.spots import PatternTaps

SHAPE = (32, 32)
OPTICS = Optics(tan_half_width=0.3, tan_half_height=0.3)
RAYS = pixel_rays(OPTICS, SHAPE)
RAYS /= np.linalg.norm(RAYS, axis=-1, keepdims=True)
DETECTOR = np.array([0.1, -0.05, 0.01])
CONTRAST = 0.8
BACKGROUND = 3e5


def scene():
    """Electrons per tap, a quarter of them dark, and ranges: a slanted wall, a box."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    range_m = 4 + columns / 16 + rows / 32
    box = (rows > 8) & (rows < 20) & (columns > 10) & (columns < 22)
    range_m[box] = 3.0
    light = 2000 * natural_image(32, 3) * (4 / range_m) ** 2
    light[:, :8] = 0
    return light, range_m


def record(light, range_m, plan, frequencies=(15e6,), rng=None, **changes):
    """Taps of every exposure, four of each frequency; with shot and read noise if ``rng``."""
    path = range_m + np.linalg.norm(range_m[..., None] * RAYS - DETECTOR, axis=-1)
    frequency = np.repeat(frequencies, 4)
    theta = np.tile(np.arange(4) * np.pi / 2, len(frequencies))
    offset = np.repeat(0.3 + np.arange(len(frequencies)), 4)
    phase = 2 * np.pi * frequency[:, None, None] * path / c + (offset - theta)[:, None, None]
    signed = plan.polarity == 0
    taps = expose(plan, light * (1 + CONTRAST * np.cos(phase))).T
    taps = taps + np.where(signed, 0, BACKGROUND)[:, None]
    values = {
        "noise_electrons": 0.0,
        "excess_noise_factor": 1.0,
        "electrons_per_count": 2.0,
        "offset_counts": 0.0 if signed.any() else 30.0,
    } | changes
    if rng is not None:
        taps = rng.poisson(taps) + rng.normal(0, values["noise_electrons"], taps.shape)
    return PatternTaps(
        **values,
        taps=(taps / 2 + values["offset_counts"])[None],
        saturated=np.zeros((1, *taps.shape), dtype=bool),
        tap_frequencies_hz=frequency,
        tap_phases_rad=theta,
        phase_offsets_rad=offset,
        detector_position_m=DETECTOR,
    )


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_all_patterns_without_noise_give_every_lit_pixel_exactly(polarity):
    light, range_m = scene()
    plan = make_plan(SHAPE, polarity=polarity)
    # Shot noise that is not there would be looked for in the readings that all share.
    readings = record(light, range_m, plan, excess_noise_factor=1e-12)
    found = dense_range(readings, plan, OPTICS)
    assert np.isnan(found[light == 0]).all()
    np.testing.assert_allclose(found[light > 0], range_m[light > 0], rtol=1e-6)
