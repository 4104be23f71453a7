"""Every shipped scene, and draws of every family, from light to errors without a warning.

Every family has a scene in the library.
"""

import warnings

import pytest

import spisim
from reconstruction import capture_warnings, evaluate, reconstruct
from reconstruction.ranging import RANGED
from spisim.instrument import needs
from spisim.scene import Scene, draw_scene, layout, list_scenes, load_scene
from spisim.scene.families import FAMILIES
from spisim.simulation.measurement import simulation_warnings

INSTRUMENT = spisim.load_instrument("paper")


def may_be_bare(scene: Scene) -> dict[int, str]:
    """Spots of which the layout tells that they give no range, or that noise may take it.

    The former meet the sky, something beyond the wrap, a pane, or what hides them from their
    detectors; the latter return less than twice what a range takes, some seven deviations.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layout, "MIN_SPOT_PER_M2", 2 * layout.MIN_SPOT_PER_M2)
        return layout.Layout(scene, needs(INSTRUMENT)).lost


def go_through(scene: Scene, *, hard: bool = False) -> None:
    """Render, reconstruct and evaluate; nothing unforeseen is warned of, everything has a value."""
    simulation = spisim.simulate(scene, INSTRUMENT, spp=8, seed=1)
    warned = simulation_warnings(INSTRUMENT, simulation.transport)
    # Tape may throw the projector's light into the detector of the spot that falls onto it.
    given = ("true image", "light's own noise", "every reading saturates")
    assert [each for each in warned if not any(words in each for words in given)] == []
    # A plain wall has hardly an image, nor has what dense smoke leaves of a tunnel. Spots on edges
    # have two echoes, far ones may as well lie beyond the wrap, and fog may leave one unsure.
    lost = may_be_bare(scene)
    given = (
        "hardly an image",
        "further echoes bias it",
        "several ranges explain it",
        "is saturated",
        "its range is too uncertain",
        *(["the spots do not share one"] if hard else []),
        *(f"spot {number} " for number in lost),
    )
    warned = capture_warnings(simulation.capture)
    assert [each for each in warned if not any(words in each for words in given)] == []
    metrics = evaluate(reconstruct(simulation.capture), simulation.capture)
    assert metrics["images"]["pursuit"]["nrmse"] is not None
    assert metrics["depths"]["anchored"]["mae_m"] is not None
    for method in ("cw", "fog"):
        status = [spot["status"] for spot in metrics["spots"][method]]
        bare = [
            status[number]
            for number in range(4)
            if number not in lost and status[number] not in RANGED
        ]
        assert set(bare) <= {"ambiguous", "saturated", "fog"} | ({"uneven fog"} if hard else set())
        assert hard or len(bare) <= 2


@pytest.mark.parametrize("name", list_scenes())
def test_library_scene(name: str) -> None:
    go_through(load_scene(name))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_draws_of_a_family(family: str, seed: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Close quarters are drawn so dark and so near that no spot may be sure.
        go_through(draw_scene(family, seed), hard=family == "close-quarters")
