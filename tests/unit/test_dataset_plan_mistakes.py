"""Plans of data sets: what is wrong with one."""

import re
from pathlib import Path
from typing import Any

import pytest

from dataplans import mistake
from reconstruction.base.errors import InputError
from spisim.dataset.planned import load_plan


def test_a_value_that_contains_itself(tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text("name: some\nscenes: [{family: targets}]\nvary: {scene.fog: &a [*a]}\n")
    with pytest.raises(InputError, match=r"plan\.yaml, line 3: a value of it contains itself"):
        load_plan(path)


def targets(**parameters: Any) -> dict[str, Any]:
    return {"family": "targets", "parameters": parameters}


VISIBILITY = "scene.fog.visibility_m"
GRIDS = {f"scene.fog.{number}": {"grid": list(range(100))} for number in range(4)}
MISTAKES: list[tuple[dict[str, Any], str]] = [
    (
        {"vary": {VISIBILITY: {"uniform": [50, 20]}}},
        "vary.scene.fog.visibility_m: needs a lower",
    ),
    ({"vary": {VISIBILITY: {"uniform": []}}}, "vary.scene.fog.visibility_m: "),
    ({"vary": {VISIBILITY: {"log_uniform": [0, 20]}}}, "greater than 0"),
    ({"vary": {VISIBILITY: {"choice": []}}}, "at least 1 item"),
    ({"vary": {VISIBILITY: {"grid": []}}}, "at least 1 item"),
    (
        {"vary": {VISIBILITY: {"grid": [1], "uniform": [1, 2]}}},
        "unknown field 'uniform'",
    ),
    (
        {"vary": {VISIBILITY: {"normal": [0, 1], "within": [10, 11]}}},
        "three standard",
    ),
    (
        {"vary": {"scene.drone.offset_m": [{"grid": [0, 1]}, 0, 0]}},
        "a grid can only stand",
    ),
    ({"vary": {"scene.drone.offset_m": [{"uniform": [1, 0]}, 0, 0]}}, "needs a lower and"),
    ({"vary": {"fog.visibility_m": 5}}, "fog.visibility_m should begin with scene. or instrument."),
    ({"vary": {"scene": 5}}, "scene should begin with"),
    ({"vary": {"scene.fog.visibilty_m": 50}}, "did you mean 'visibility_m'?"),
    ({"vary": {"scene.fgo.visibility_m": 50}}, "did you mean 'fog'?"),
    ({"vary": {"instrument.laser.power_w": 1}}, "did you mean 'lasers'?"),
    ({"vary": {"instrument.wavelength_nm.a": 1}}, "wavelength_nm has no fields; it is 1550"),
    ({"vary": {VISIBILITY: {"grid": [50, -1]}}}, "greater than 0; found -1"),
    ({"materials": {"concrete": "wood-dryy"}}, "did you mean 'wood-dry'"),
    ({"materials": {"concrete": {"uniform": [2, 1]}}}, "materials.concrete: needs a lower and"),
    ({"scenes": []}, "scenes: should have at least 1 item"),
    ({"scenes": [{"family": "target"}]}, "did you mean 'targets'?"),
    ({"scenes": [{"scene": "warehose"}]}, "did you mean 'warehouse'?"),
    ({"scenes": [{"scene": "missing.yaml"}]}, "missing.yaml: no such file"),
    ({"scenes": [{}]}, "scenes[0]: should have either scene or family"),
    (
        {"scenes": [{"scene": "warehouse", "family": "targets"}]},
        "either scene or family",
    ),
    ({"scenes": [{"scene": "warehouse", "distinct": 2}]}, "are only for a family"),
    (
        {"scenes": [{"family": "targets", "parameters": {"distance": 2}}]},
        "did you mean 'distance_m'?",
    ),
    (
        {"scenes": [targets(distance_m={"uniform": [3, 2]})]},
        "needs a lower and",
    ),
    ({"scenes": [targets(distance_m=1e4)]}, "distance_m"),
    (
        {"scenes": [{"family": "targets", "weight": 0}]},
        "should have a finite sum above 0",
    ),
    ({"scenes": [{"family": "targets", "weight": -1}]}, "scenes[0].weight: should be greater"),
    ({"instrument": "papier"}, "did you mean 'paper'?"),
    ({"wavelength_nm": "infrared"}, "wavelength_nm: should be a number; found 'infrared'"),
    ({"wavelength_nm": {"grid": [905, "a"]}}, "wavelength_nm: should be a number, not 'a'"),
    ({"wavelength_nm": {"uniform": [950, 900]}}, "wavelength_nm: needs a lower and"),
    ({"wavelength_nm": 2000}, "wavelength_nm: should be from 800 to 1600; found 2000"),
    ({"samples": 0}, "samples: should be greater than 0"),
    ({"samples": "many"}, "samples: "),
    ({"seed": -1}, "seed: should be greater"),
    (
        {"spp": 8, "transport_noise_share": 0.1},
        "have spp or transport_noise_share, not both",
    ),
    ({"light": "surogate"}, "light: should be 'traced' or 'surrogate'"),
    ({"light": "surrogate", "spp": 8}, "light: surrogate is not traced; remove spp and"),
    ({"frame": 2}, "did you mean 'frames'?"),
    ({"keep": {"truths": True}}, "did you mean 'truth'?"),
    ({"name": ""}, "name: "),
    ({"spp": 2**21}, "spp: should be less than or equal to 1048576; found 2097152"),
    (
        {"transport_noise_share": 1e-9},
        "transport_noise_share: should be greater than or equal to 0.001; found 1e-09",
    ),
    ({"transport_error": 0.01}, "transport_error was replaced by transport_noise_share, the"),
    ({"seed": True}, "seed: should be a number; found True"),
    ({"samples": 10**8}, "samples: should be less than or equal to 10000000"),
    ({"samples": None, "vary": GRIDS}, "the plan has 100000000 samples; at most 10000000"),
    ({"vary": {VISIBILITY: {"uniform": [20, float("inf")]}}}, "finite number"),
    ({"vary": {VISIBILITY: {"uniform": ["a", "b"]}}}, "should be a valid number, unable to parse"),
    ({"vary": {VISIBILITY: {"unifrom": [20, 30]}}}, "valid number; found {'unifrom': [20, 30]}"),
    ({"vary": {VISIBILITY: {"choice": [{"uniform": [30, 20]}]}}}, "needs a lower and"),
    ({"vary": {VISIBILITY: {"choice": [{"grid": [30, 20]}]}}}, "a grid can only stand"),
    ({"vary": {VISIBILITY: {"choice": 20}}}, "should be a list; found {'choice': 20}"),
    ({"vary": {"scene.material_swaps": 3}}, "material_swaps has no fields; it is 3"),
    ({"scenes": [{"family": "targets", "weight": 1e308}] * 2}, "weight: should be within ±1e+30"),
    ({"scenes": [{"family": "targets", "distinct": 2**32}]}, "distinct: should be less than"),
    (
        {
            "scenes": [{"family": "targets", "weight": 0}, {"scene": "warehouse"}],
            "every_scene": True,
        },
        "every_scene includes scenes of weight 0; remove them",
    ),
]


@pytest.mark.parametrize(("changes", "said"), MISTAKES, ids=[said for _, said in MISTAKES])
def test_mistakes_are_named(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    assert said in " ".join(mistake(tmp_path, **changes).split())


def test_a_value_that_fails_late_in_a_grid_is_found_early(tmp_path: Path) -> None:
    vary = {
        "scene.fog.visibility_m": {"grid": [float(metres) for metres in range(10, 60)]},
        "scene.ambient.sky_klx": {"grid": [0.1, 0.2, -5.0]},
    }
    message = mistake(tmp_path, samples=150, vary=vary)
    assert re.search(r"sample 2: scene warehouse: ambient\.sky_klx", message)


def test_no_such_plan(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml: no such file"):
        load_plan(tmp_path / "none.yaml")


def test_a_material_that_no_scene_has(tmp_path: Path) -> None:
    said = mistake(tmp_path, materials={"concrte": "cardboard"})
    assert "materials: no scene has 'concrte': did you mean 'concrete'?" in said
