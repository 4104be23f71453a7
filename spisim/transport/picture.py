"""Pictures of a camera at the instrument's wavelength."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spisim.instrument import Instrument
from spisim.instrument.views import InstrumentView, ProjectorView
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.daylight import has_daylight, sky_of, sun_of
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.estimator import image_light, transport_image
from spisim.transport.engine.gather import Gather
from spisim.transport.engine.lights import Lamp
from spisim.transport.engine.sampling import PathBudget, repeat
from spisim.transport.engine.tally import ImageTally, Sums, Tallies
from spisim.transport.engine.walk import MAX_VERTICES, Walk
from spisim.transport.engine.weights import alone
from spisim.transport.lamps import lamps_of
from spisim.transport.world import build_world

#: Height of the camera above the pinhole: with light and camera in one point there is no shading.
CAMERA_OFFSET_M = 0.05
ABOVE_M = (0.0, -CAMERA_OFFSET_M, 0.0)


@with_backend
def fine_view(
    scene: Scene, instrument: Instrument, *, refine: int = 4, spp: int = 16, seed: int = 0
) -> NDArray[np.float32]:
    """Transport image with `refine`² smaller pixels in each virtual pixel.

    It is what the instrument would see with that many pixels. In fog it is less noisy than a
    camera's picture, because light is traced from both ends.

    Parameters
    ----------
    scene, instrument
        What is seen, and by what.
    refine
        Small pixels per side of a virtual pixel.
    spp
        Paths per small pixel from either end.
    seed
        Seed of the random numbers.

    Returns
    -------
    NDArray
        Image (refine · H, refine · W): fraction of a virtual pixel's power on the detector, whose
        mean over the small pixels is the transport image.

    Raises
    ------
    InputError
        If the scene was made for another wavelength.
    """
    placed = InstrumentView.placed(scene, instrument)
    height, width = placed.projector.shape
    fine = replace(placed.projector, shape=(refine * height, refine * width))
    stream = np.random.SeedSequence(seed)
    world = build_world(scene)
    image = transport_image(world, fine, placed.bucket, PathBudget(spp), seed=stream).mean["image"]
    return image.reshape(fine.shape).astype(np.float32)


@with_backend
def camera_view(
    scene: Scene,
    instrument: Instrument,
    *,
    width: int = 256,
    height: int = 256,
    fov_deg: float | None = None,
    pattern: NDArray[np.floating] | None = None,
    position_m: tuple[float, float, float] = ABOVE_M,
    spp: int = 32,
    seed: int = 0,
    max_vertices: int = MAX_VERTICES,
) -> NDArray[np.float32]:
    """In-band radiance of the lit pattern, sun, sky and lamps together.

    The projector's light is traced from both ends; sun, sky and lamps from the camera alone. Point
    lamps are not seen themselves, only what they light.

    Parameters
    ----------
    scene, instrument
        What is seen, and the projector that lights it.
    width, height
        Number of pixels.
    fov_deg
        Full angle across the width, by default the projector's.
    pattern
        Fraction of each virtual pixel's power (H, W), by default all on.
    position_m
        Position of the camera in the optical frame; it looks along the optical axis.
    spp
        Paths per pixel from either end.
    seed
        Seed of the random numbers.
    max_vertices
        Light that is scattered more often is left out.

    Returns
    -------
    NDArray
        Radiance (height, width), W m⁻² sr⁻¹.

    Raises
    ------
    InputError
        If the scene was made for another wavelength.
    """
    placed = InstrumentView.placed(scene, instrument).projector
    world = build_world(scene)
    view = camera_at(scene, placed, width, height, fov_deg, position_m)
    lit = np.ones(placed.shape) if pattern is None else np.asarray(pattern)
    power_w = instrument.pixel_powers_w * lit
    total_w = float(power_w.sum())
    lamps = lamps_of(scene, instrument, world)
    sky = sky_of(scene, instrument)
    sun = sun_of(scene, instrument, world)

    def launch(samples: float, seeds: Sequence[int], replicas: int) -> Sums:
        camera = Projector.of(view, samples)  # a pixel sees along the rays that it would emit
        ours, rest = (Tallies(view.pixels, [ImageTally]) for _ in range(2))
        if total_w > 0:
            lamp = Lamp.of(placed, power_w, camera.lanes)
            image_light(world, camera, lamp, seeds, ours.add, max_vertices=max_vertices)
        if has_daylight(scene):
            walk = Walk(world, camera, sun, False, alone, rest.add, sky=sky)
            walk.run(seeds[0] ^ 1, max_vertices)
        if lamps is not None:
            Gather(world, camera, lamps, rest.add).run(seeds[1] ^ 1, max_vertices)
        lit, sunny = ours.read(1.0), rest.read(1.0)
        values = [
            {"radiance": total_w * one["image"] + other["image"]}
            for one, other in zip(lit.values, sunny.values, strict=True)
        ]
        return Sums(values, lit.dropped + sunny.dropped)

    radiance = repeat(launch, PathBudget(spp), view.pixels, np.random.SeedSequence(seed), None)
    return radiance.mean["radiance"].reshape(height, width).astype(np.float32)


def camera_at(
    scene: Scene,
    projector: ProjectorView,
    width: int,
    height: int,
    fov_deg: float | None = None,
    position_m: tuple[float, float, float] = ABOVE_M,
) -> ProjectorView:
    """A pinhole camera in the optical frame, whose pixels see along the rays of a projector's."""
    pose = scene.drone_pose.copy()
    pose[:3, 3] += pose[:3, :3] @ np.asarray(position_m)
    tan_half = projector.tan_half_width if fov_deg is None else np.tan(np.radians(fov_deg) / 2)
    return ProjectorView(pose, (height, width), tan_half, tan_half * height / width)
