"""Which ranges a recording gets when nobody names any."""

import pytest

import spisim
from reconstruction import Reconstructor


@pytest.mark.parametrize(
    ("preset", "expected"),
    [
        ("paper", ["fog", "cw"]),  # one frequency
        ("fog", ["fog", "cw"]),
        ("hybrid", ["fog", "pulsed"]),  # three windows
        ("fog-spad", ["fog", "dtof"]),
    ],
)
def test_fog_comes_first_where_it_may_be(preset, expected) -> None:
    instrument = spisim.load_instrument(preset)
    capture = spisim.simulate(
        spisim.load_scene("target-plane"), instrument, light="surrogate"
    ).capture
    usual, alone = (
        Reconstructor(capture.setup, ranging=names, depth=())(capture.frame(0)).rangings
        for names in ("usual", None)
    )
    assert list(usual) == expected
    assert list(alone) == expected[:1]
