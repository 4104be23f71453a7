"""What a wavelength changes in the light that is recorded, against spectra and Mie tables."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import worlds
from spisim.atmosphere import fog
from spisim.budget import Target, bucket_link
from spisim.instrument import load_instrument
from spisim.scene import Ambient, in_band_irradiance
from spisim.simulation.light import solve
from spisim.simulation.measurement.light import background_electrons
from spisim.transport import Outputs

WALL_M = 4.0
SUNLIT = worlds.scene(
    worlds.plane(WALL_M, 0.5), ambient=Ambient(sun_klx=40, sun_direction=(0, 0, 1))
)
HERE = load_instrument("paper")


def at(scene, wavelength_nm):
    return replace(scene, wavelength_nm=float(wavelength_nm))


@cache
def daylight_w(wavelength_nm):
    one = HERE.at_wavelength(wavelength_nm)
    return solve(at(SUNLIT, wavelength_nm), one, spp=4, seed=0).daylight_w


@pytest.mark.parametrize("wavelength_nm", [850, 905, 940, 1460])
def test_background_follows_the_spectrum(wavelength_nm):
    """Photons, as quantum efficiency stays: watts in the band times wavelength, both traced."""
    there = HERE.at_wavelength(wavelength_nm)
    here, moved = daylight_w(HERE.wavelength_nm), daylight_w(wavelength_nm)
    bands = there.filter.band_nm, HERE.filter.band_nm
    watts = np.divide(*(in_band_irradiance(1, band) for band in bands))
    assert moved / here == pytest.approx(watts, rel=1e-5)  # the same paths: no noise between them
    dark = background_electrons(HERE, 0.0)
    electrons = (background_electrons(there, moved) - dark) / (
        background_electrons(HERE, here) - dark
    )
    # a flat responsivity within each band leaves the photon's energy at the band's centre
    assert electrons == pytest.approx(watts * wavelength_nm / 1550, rel=1e-5)


@pytest.mark.parametrize("wavelength_nm", [850, 1550])
def test_fog_of_the_wavelength_reaches_the_transport(wavelength_nm):
    """Unscattered light of a pixel that faces the wall, against Beer's law."""
    medium = fog(20, "haze-l", wavelength_nm=wavelength_nm)
    instrument = HERE.at_wavelength(wavelength_nm)
    hazy = at(replace(SUNLIT, atmosphere=medium), wavelength_nm)
    light = solve(hazy, instrument, spp=16, seed=1, outputs=Outputs(orders=True))
    straight = (light.extra["orders"][0] * instrument.pixel_powers_w).sum()
    target = Target(WALL_M, 0.5, 0.0, medium.extinction_per_m)
    assert straight == pytest.approx(float(bucket_link(instrument, target).signal_w), rel=0.01)
