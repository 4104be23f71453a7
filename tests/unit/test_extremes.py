"""Numbers that no memory would hold: each is refused in a sentence that tells them."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hostile
import spisim
from foreign import taken
from reconstruction.base.errors import InputError
from spisim.dataset.flight import instants
from spisim.scene import Scene, check_clear_path, draw_scene, load_trajectory, make_scene
from spisim.scene.motion import check_clear_of_sensor
from spisim.simulation.drops.field import drop_field
from spisim.transport import ground_truth, truth

WALL = "{name: w, shape: box, size_m: [0.1, 8, 8], material: concrete, translate_m: [4, 0, 0]"


def scene(more: str = "", of_wall: str = "") -> Scene:
    text = f"name: s\ndrone: {{position_m: [0, 0, 0], look_at_m: [1, 0, 0]}}\n{more}\n"
    return make_scene(f"{text}objects:\n  - {WALL}{of_wall}}}\n", Path(), "text")


def refused(call: Callable[[], object], message: str) -> None:
    def attack(_: int) -> None:
        with pytest.raises(InputError, match=message) as reported:
            call()
        assert "\n" not in str(reported.value)

    hostile.survive(attack, [0], readable=[Path("/")], writable=[Path(tempfile.gettempdir())])


def flight(folder: Path, end: str) -> Path:
    file = folder / "flight.csv"
    file.write_text(f"t,x,y,z,look_x,look_y,look_z\n0,0,0,0,4,0,0\n{end},4,0,0\n")
    return file


@pytest.mark.parametrize("wind", ["1.0e+9", "1.0e+29"])
def test_drops_in_a_wind_beyond_all_bounds(wind: str) -> None:
    position = scene(f"rain: {{rate_mm_per_h: 10, model: drops, wind_m_s: [{wind}, 0, 0]}}")
    (drops,) = position.precipitation
    instrument, rng = spisim.load_instrument("paper"), np.random.default_rng(0)
    refused(lambda: drop_field(drops, position, instrument, 1, rng), "drops would cross the field")


def test_a_flight_that_never_ends(tmp_path: Path) -> None:
    path = load_trajectory(flight(tmp_path, "1e9,0,0.1,0"))
    instrument = spisim.load_instrument("paper")
    refused(lambda: instants(scene(), path, instrument, 2.0, 0), "has 2e[+]09 captures")


def test_a_flight_to_the_stars(tmp_path: Path) -> None:
    path = load_trajectory(flight(tmp_path, "10,0,9e9,0"))
    refused(lambda: check_clear_path(scene(), path), "takes 1.8e[+]11 steps")


def test_an_object_that_spins_beyond_all_bounds() -> None:
    position = scene(of_wall=", angular_velocity_deg_s: [0, 0, 1.0e+30]")
    refused(lambda: check_clear_of_sensor(position, 1.0), "'w' moves too far or turns too often")


def test_a_mesh_beyond_all_bounds(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1e308 0 0\nv 0 1e308 0\nf 1 2 3\n")
    refused(lambda: taken(tmp_path / "a.obj"), "reaches 1e[+]308 from its origin")


def test_more_copies_than_memory_holds() -> None:
    """A ball has 5120 triangles."""
    copies = "[" + "{}, " * 4000 + "]"
    ball = f"{{name: b, shape: sphere, radius_m: 0.1, material: concrete, instances: {copies}}}"
    text = f"name: s\ndrone: {{position_m: [0, 0, 0], look_at_m: [1, 0, 0]}}\nobjects: [{ball}]"
    refused(lambda: make_scene(text, Path(), "text"), "20,480,000 triangles, instances counted")


def test_a_pose_beyond_all_bounds(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    refused(lambda: taken(tmp_path / "a.obj", scale=1e9), "reaches 5e[+]08 m .*--units and --scale")


def test_a_sapling_on_a_bank_above_its_bough() -> None:
    """Its stem was folded back onto itself, where a tube has no direction."""
    drawn = draw_scene("forest-trail", 1543079293)
    assert all(np.isfinite(thing.mesh.vertices).all() for thing in drawn.objects)


def test_ground_truth_in_bands_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    position, instrument = scene(), spisim.load_instrument("paper")
    whole = ground_truth(position, instrument)
    monkeypatch.setattr(truth, "RAYS_AT_A_TIME", 5 * 64 * truth.SUBPIXELS**2)
    bands = ground_truth(position, instrument)
    for field in ("range_m", "depth_m", "reflectance", "normal", "object_id", "coverage"):
        np.testing.assert_array_equal(getattr(bands, field), getattr(whole, field))
