"""The least range of a spot, by where its beam enters the field of its detector."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.capture import Spots
from reconstruction.ranging import blind_below_m
from spisim.instrument import SpotLight, load_instrument


def recording(name: str) -> Spots:
    """One frame in the dark."""
    instrument = load_instrument(name)
    spots = instrument.ranging.spots
    dark = SpotLight(np.arange(8) * 0.01, np.zeros((1, spots, 8)), np.zeros((1, spots)), 1.0)
    return instrument.ranging.tof.record(dark, instrument.spot_optics, None)


@pytest.mark.parametrize(("name", "sigmas"), [("fog-spad", 3.0), ("spad", 3.0), ("fog", 0.0)])
def test_the_field_s_edge_meets_the_aperture_s_side_of_the_beam(name: str, sigmas: float) -> None:
    """Where aside - aperture - sigmas of the beam = r tan(half field), and some light more."""
    spots = recording(name)
    ahead = (spots.detector_positions_m * spots.directions).sum(axis=1)
    aside = np.sqrt((spots.detector_positions_m**2).sum(axis=1) - ahead**2)
    range_m = np.linspace(0.05, 3, 2951)
    beam = sigmas * np.hypot(spots.beam_waist_m, spots.beam_divergence_rad * range_m)
    outside = aside[:, None] - spots.aperture_radii_m[:, None] - beam
    within = outside < range_m * np.tan(spots.half_fields_rad)[:, None]
    onset_m = range_m[within.argmax(axis=1)]
    blind_m = blind_below_m(spots)
    assert (blind_m > onset_m).all()
    np.testing.assert_allclose(blind_m, onset_m, rtol=0.2)


@pytest.mark.parametrize(("name", "expected_m"), [("fog-spad", 1.45), ("fog", 0.22)])
def test_presets(name: str, expected_m: float) -> None:
    np.testing.assert_allclose(blind_below_m(recording(name)), expected_m, rtol=0.1)


@pytest.mark.parametrize("name", ["tmf8820", "vl53l5cx"])
def test_zones_see_from_centimetres_on(name: str) -> None:
    assert (blind_below_m(recording(name)) < 0.03).all()


def test_unknown_optics_leave_it_unknown() -> None:
    spots = recording("fog-spad")
    unknown = replace(spots, half_fields_rad=np.full(len(spots.directions), np.nan))
    assert np.isnan(blind_below_m(unknown)).all()
