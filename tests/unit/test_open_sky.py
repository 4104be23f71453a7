"""A scene without any object: fog alone, or nothing at all."""

from dataclasses import replace

import numpy as np
import pytest

import spisim
from spisim.atmosphere import CLEAR


@pytest.fixture(scope="module")
def fog():
    return replace(spisim.load_scene("warehouse"), objects=())


@pytest.mark.parametrize("light", ["surrogate", "traced"])
def test_it_has_no_depth_and_its_lasers_meet_nothing(fog, light):
    capture = spisim.simulate(fog, spisim.load_instrument("paper"), light=light).capture
    assert np.isnan(capture.truth.depth_m).all()
    assert np.isnan(capture.truth.spot_range_m).all()


def test_fog_returns_light_and_clear_air_does_not(fog):
    instrument = spisim.load_instrument("fog")
    light = [
        spisim.simulate(
            replace(fog, atmosphere=air), instrument, light="surrogate"
        ).capture.truth.image.mean()
        for air in (fog.atmosphere, CLEAR)
    ]
    assert light[0] > 0
    assert light[1] == 0


def test_it_is_drawn_and_described(fog):
    assert "objects" in fog._repr_html_()
    assert len(fog.plot()) == 2
    assert "objects: 0" in repr(fog)
