"""No ranges of fog alone: of zones, next to which fog is brightest, and of a threshold's stamps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from spots_zones import Wall

from reconstruction.capture import Spots
from reconstruction.ranging import Ranges, measure_ranges
from spisim.atmosphere import CLEAR, fog
from spisim.instrument import load_instrument
from spisim.scene import Ambient, Scene
from spisim.simulation import simulate


def scene(nm: float, visibility_m: float | None, wall_m: float | None, reflectance: float) -> Scene:
    air = fog(visibility_m, "heavy-advection", wavelength_nm=nm) if visibility_m else CLEAR
    walls = () if wall_m is None else (Wall(wall_m, reflectance=reflectance).thing("wall"),)
    return Scene("fog", walls, air, Ambient(), np.eye(4), wavelength_nm=nm)


@cache
def recorded(
    name: str, visibility_m: float | None, wall_m: float | None = None, reflectance: float = 0.3
) -> Spots:
    """A frame by light that is scattered once."""
    instrument = load_instrument(name)
    where = scene(float(instrument.wavelength_nm), visibility_m, wall_m, reflectance)
    spots = simulate(where, instrument, light="surrogate", seed=3).capture.spots
    assert spots is not None
    return spots


def ranges(spots: Spots) -> Ranges:
    return measure_ranges(spots, method="fog" if spots.piles_up else "dtof")


@pytest.mark.parametrize("visibility_m", [10.0, 35.0, 200.0])
@pytest.mark.parametrize("name", ["tmf8820", "vl53l5cx", "rangefinder-905"])
def test_fog_alone_has_no_range(name: str, visibility_m: float) -> None:
    assert not ranges(recorded(name, visibility_m)).valid.any()


@pytest.mark.parametrize(("visibility_m", "reflectance"), [(20.0, 0.1), (50.0, 0.05), (None, 0.05)])
def test_zones_see_walls_in_fog(visibility_m: float | None, reflectance: float) -> None:
    result = ranges(recorded("tmf8820", visibility_m, 0.8, reflectance))
    directions = load_instrument("tmf8820").zones.directions
    assert result.valid.mean() >= 8 / 9
    np.testing.assert_allclose(result.range_m, 0.8 / directions[:, 2], atol=0.05)


@pytest.mark.parametrize("visibility_m", [10.0, 50.0, None])
@pytest.mark.parametrize("wall_m", [0.6, 0.8, 1.0])
def test_a_near_echo_rises_before_the_gate(wall_m: float, visibility_m: float | None) -> None:
    """Its edge is above the threshold before the pulse's centre has left."""
    result = ranges(recorded("rangefinder-905", visibility_m, wall_m))
    assert result.status == ("ok",)
    assert abs(result.range_m[0] - wall_m) < 0.05


@pytest.mark.parametrize("wall_m", [1.5, 2.0, 4.0, 6.0])
@pytest.mark.parametrize("visibility_m", [10.0, 50.0, 200.0])
def test_a_threshold_s_midpoint_of_fog_and_wall_is_no_range(
    wall_m: float, visibility_m: float
) -> None:
    result = ranges(recorded("rangefinder-905", visibility_m, wall_m, 0.1))
    assert not result.valid.any() or abs(result.range_m[0] - wall_m) < 0.3


def test_stamps_that_scatter_by_metres_are_ambiguous() -> None:
    spots = recorded("rangefinder-905", None, 4.0)
    times = np.arange(spots.counts.shape[-1])
    spread = np.exp(-(((times - 200) / 10) ** 2) / 2)
    scattered = np.round(150 * spread / spread.sum()).astype(np.int32)[None, None]
    assert ranges(replace(spots, counts=scattered)).status == ("ambiguous",)
