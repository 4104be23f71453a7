"""A camera's picture of a lit scene: traced from both ends, it is that of one."""

from dataclasses import replace

import numpy as np
import pytest

import worlds
from spisim.instrument import load_instrument
from spisim.scene import load_scene
from spisim.scene.pose import look_at
from spisim.transport import camera_view
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.estimator import image_light
from spisim.transport.engine.lights import Lamp
from spisim.transport.engine.tally import ImageTally, Tallies
from spisim.transport.engine.walk import Walk
from spisim.transport.engine.weights import alone
from spisim.transport.picture import CAMERA_OFFSET_M, camera_at
from spisim.transport.world import build_world

RUNS = 40
#: From both ends, by the extinction of the fog: scarcely noisier than the reference.
PATHS = {0.0: 128, 0.1: 64}
VIEW = worlds.projector(shape=(8, 8))
CAMERA = worlds.projector(shape=(8, 8), pose=worlds.pose_at((0.0, -0.05, 0.0)))
PATTERN = np.indices(VIEW.shape).sum(axis=0) % 3 / 2.0  # dark, half and full


@pytest.mark.parametrize("extinction", [0.0, 0.1])
def test_both_ends_see_what_the_camera_alone_sees(extinction: float, reference) -> None:
    world = build_world(
        worlds.scene(*worlds.room(), extinction_per_m=extinction, albedo=0.95, g=0.7)
    )

    def picture(seed: int, both: bool) -> np.ndarray:
        camera = Projector.of(CAMERA, PATHS[extinction] if both else 2048)
        tallies = Tallies(camera.pixels, [ImageTally])
        lamp = Lamp.of(VIEW, PATTERN, camera.lanes)
        if both:
            image_light(world, camera, lamp, [3 * seed, 3 * seed + 1, 3 * seed + 2], tallies.add)
        else:
            Walk(world, camera, lamp, False, alone, tallies.add).run(1000 + seed)
        (sums,) = tallies.read(1.0).values
        image = sums["image"]
        return np.append(image, image.sum())

    theirs = reference(
        f"picture by the camera alone, extinction {extinction}",
        lambda seeds: np.array([picture(n, False) for n in seeds]),
        RUNS,
    )
    ours = np.array([picture(n, True) for n in range(RUNS)])
    z = np.abs(theirs.z_score(ours))
    assert np.all(z < 5)
    assert z[-1] < 4
    if extinction:
        assert ours.var(axis=0)[:-1].sum() < theirs.variance[:-1].sum()


def test_a_dark_pattern_shows_daylight_alone() -> None:
    scene, instrument = load_scene("target-plane"), load_instrument("paper")
    dark = np.zeros(instrument.pixel_powers_w.shape)
    view = camera_view(scene, instrument, width=8, height=8, pattern=dark, spp=8)
    lit = camera_view(scene, instrument, width=8, height=8, spp=8)
    assert np.isfinite(view).all()
    assert (view < lit).all()


def test_the_radiance_of_a_lit_wall_is_that_of_its_irradiance() -> None:
    """L = ρ E / π with E = P / (4 d² tan² of the half angle), the same all over the wall."""
    scene, instrument = worlds.scene(worlds.plane(5.0, 0.4)), load_instrument("paper")
    projector = instrument.imaging.projector
    lit_m2 = 4 * 5.0**2 * projector.tan_half_width * projector.tan_half_height
    view = camera_view(
        scene, instrument, width=4, height=4, position_m=(0, 0, 0), spp=64, max_vertices=1
    )
    irradiance = instrument.pixel_powers_w.sum() / lit_m2
    np.testing.assert_allclose(view, 0.4 * irradiance / np.pi, rtol=0.02)


def test_the_camera_sits_above_the_light() -> None:
    """Shadows lie below what casts them, as the drone's light has them."""
    level = replace(worlds.scene(), drone_pose=look_at((1, 2, 3), (5, 2, 3), (0, 0, 1)))
    camera = camera_at(level, VIEW, 4, 4)
    np.testing.assert_allclose(camera.pose[:3, 3], (1, 2, 3 + CAMERA_OFFSET_M), atol=1e-6)
