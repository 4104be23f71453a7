"""State of the calling process: a Mitsuba variant, NumPy's error state, a user without a home."""

import subprocess
import sys
from collections.abc import Iterator

import mitsuba as mi
import numpy as np
import pytest

import reconstruction
import spisim
from instruments import changed
from reconstruction import InputError
from spisim.budget import longest_range_m
from spisim.transport import RayCaster
from spisim.transport.backend import activate, active

#: A user id without an entry in the password database, wherever the tests run.
NO_HOME = """
import os, pwd
os.environ.pop("HOME", None)
def getpwuid(number):
    raise KeyError(number)
pwd.getpwuid = getpwuid
"""


@pytest.fixture
def own_variant() -> Iterator[str]:
    before = activate()
    mi.set_variant("scalar_rgb")
    yield "scalar_rgb"
    mi.set_variant(before)


def simulated() -> spisim.Simulation:
    scene, instrument = spisim.load_scene("target-plane"), spisim.load_instrument("paper")
    return spisim.simulate(scene, instrument, spp=1, noise=False)


def test_a_variant_of_the_user_is_selected_again(own_variant: str) -> None:
    simulated()
    assert mi.variant() == own_variant


def test_rays_are_cast_in_our_variant(own_variant: str) -> None:
    caster = RayCaster.of(spisim.load_scene("target-plane"))
    surfaces = caster.along(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]))
    assert surfaces.range_m.shape == (1,)
    assert mi.variant() == own_variant


def test_the_last_thread_restores_the_variant(own_variant: str) -> None:
    """Another thread that still traces light keeps ours."""
    with active as ours:
        with active:
            pass
        assert mi.variant() == ours
    assert mi.variant() == own_variant


def test_a_variant_is_restored_after_an_error(own_variant: str) -> None:
    with pytest.raises(ZeroDivisionError), active:
        raise ZeroDivisionError
    assert mi.variant() == own_variant


def test_strict_float_errors_of_the_user_do_not_reach_the_budget() -> None:
    rangefinder = changed("rangefinder-905", tof__threshold_sigma=5.3)  # whose table is not cached
    with np.errstate(all="raise"):
        assert longest_range_m(rangefinder, 0.1) > 10


def test_strict_float_errors_of_the_user_reach_no_further_than_the_entry_points() -> None:
    """Exponentials of far distances underflow; the caller's own numbers still raise."""
    with np.errstate(all="raise"):
        capture = simulated().capture
        result = reconstruction.reconstruct(capture)
        reconstruction.evaluate(result, capture)
        with pytest.raises(FloatingPointError):
            np.exp(np.float64(-1e4))


@pytest.mark.parametrize(
    "code",
    [
        "import spisim; spisim.load_scene('target-plane')",
        "from spisim.atmosphere.lookup import cached; cached('a', dict)",
        "from spisim_formats.cli.importing import _fuel_cache; assert _fuel_cache() is None",
    ],
)
def test_a_user_without_a_home(code: str) -> None:
    run = subprocess.run(
        [sys.executable, "-c", NO_HOME + code], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("spp", [0, -8, 8.5, True])
def test_paths_are_a_whole_number(spp: float) -> None:
    scene, instrument = spisim.load_scene("target-plane"), spisim.load_instrument("paper")
    with pytest.raises(InputError, match=r"spp is .*, must be a whole number of at least 1"):
        spisim.simulate(scene, instrument, spp=spp)
