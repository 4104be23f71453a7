"""Every shipped scene, and draws of every family, from light to errors without a warning.

Every family has a scene in the library.
"""

import warnings

import pytest

import spisim
from reconstruction import capture_warnings, evaluate, reconstruct
from reconstruction.ranging import RANGED
from spisim.measurement import simulation_warnings
from spisim.scene import Scene, draw_scene, list_scenes, load_scene
from spisim.scene.families import FAMILIES

INSTRUMENT = spisim.load_instrument("paper")


def go_through(scene: Scene) -> None:
    """Render, reconstruct and evaluate; nothing warns, and everything has a value."""
    simulation = spisim.simulate(scene, INSTRUMENT, spp=8, seed=1)
    warned = simulation_warnings(INSTRUMENT, simulation.transport)
    few_paths = ("true image", "light's own noise")
    assert [each for each in warned if not any(words in each for words in few_paths)] == []
    # A plain wall has hardly an image, nor has what dense smoke leaves of a tunnel. Spots on edges
    # have two echoes, and dark far ones may as well lie beyond the wrap.
    warned = capture_warnings(simulation.capture)
    known = ("hardly an image", "further echoes bias it", "several ranges explain it")
    assert [each for each in warned if not any(words in each for words in known)] == []
    metrics = evaluate(reconstruct(simulation.capture), simulation.capture)
    assert metrics["images"]["pursuit"]["nrmse"] is not None
    assert metrics["depths"]["anchored"]["mae_m"] is not None
    plain = [spot["status"] for spot in metrics["spots"]["cw"]]
    assert plain.count("ok") >= 3  # next to the wrap a range is ambiguous
    assert set(plain) <= {"ok", "ambiguous"}
    assert sum(spot["status"] in RANGED for spot in metrics["spots"]["fog"]) >= 3


@pytest.mark.parametrize("name", list_scenes())
def test_library_scene(name: str) -> None:
    go_through(load_scene(name))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_draws_of_a_family(family: str, seed: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        go_through(draw_scene(family, seed))
