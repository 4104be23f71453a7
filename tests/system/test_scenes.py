"""Every shipped scene, and draws of every family, from light to errors without a warning.

Every family has a scene in the library.
"""

import warnings

import pytest

import spisim
from reconstruction import capture_warnings, evaluate, reconstruct
from reconstruction.ranging import RANGED
from spisim.instrument import needs
from spisim.measurement import simulation_warnings
from spisim.scene import Scene, draw_scene, list_scenes, load_scene
from spisim.scene.families import FAMILIES
from spisim.scene.layout import Layout

INSTRUMENT = spisim.load_instrument("paper")


def go_through(scene: Scene) -> None:
    """Render, reconstruct and evaluate; nothing unforeseen is warned of, everything has a value.

    Foreseen are the spots of which the scene's layout tells that they give no range: those that
    meet the sky, something beyond the wrap, a pane, or what hides them from their detectors.
    """
    lost = Layout(scene, needs(INSTRUMENT)).lost
    simulation = spisim.simulate(scene, INSTRUMENT, spp=8, seed=1)
    warned = simulation_warnings(INSTRUMENT, simulation.transport)
    few_paths = ("true image", "light's own noise")
    assert [each for each in warned if not any(words in each for words in few_paths)] == []
    # A plain wall has hardly an image, nor has what dense smoke leaves of a tunnel. Spots on edges
    # have two echoes, and of dark far ones some are as faint as noise, or may lie beyond the wrap.
    known = (
        "hardly an image",
        "further echoes bias it",
        "too weak to tell from noise",
        "several ranges explain it",
        *(f"spot {number} " for number in lost),
    )
    warned = capture_warnings(simulation.capture)
    assert [each for each in warned if not any(words in each for words in known)] == []
    metrics = evaluate(reconstruct(simulation.capture), simulation.capture)
    assert metrics["images"]["pursuit"]["nrmse"] is not None
    assert metrics["depths"]["anchored"]["mae_m"] is not None
    for method in ("cw", "fog"):
        status = [spot["status"] for spot in metrics["spots"][method]]
        returned = [status[number] for number in range(4) if number not in lost]
        bare = [each for each in returned if each not in RANGED]
        assert bare in ([], ["ambiguous"], ["no signal"], ["weak"])


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
