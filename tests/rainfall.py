"""Rain before a wall, and single drops that hang in the air, shared by the tests."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import spisim
import worlds
from spisim.atmosphere.precipitation import rain
from spisim.instrument import Instrument
from spisim.simulation.drops import falling_drops, on_buckets
from spisim.simulation.light import LightSequence

WALL_M = 3.0
NEAR_M = 0.4
FOG_PER_M = 0.05
LENGTHS = np.arange(400) * 0.02


def instrument(
    patterns=1,
    detectors=((0.05, 0.02, 0.0),),
    shape=(16, 16),
    lasers=None,
    tof_fov_deg=1.2,
    **projector,
):
    """The paper's, with a narrower field, few patterns and beams of some width."""
    fields = spisim.load_instrument("paper").model_dump(exclude_none=True)
    fields["projector"] |= {"shape": shape, "fov_deg": 8, **projector}
    fields["plan"] |= {"patterns": patterns}
    fields["detector"]["positions_m"] = detectors
    directions = [(-2, 2), (2, 2), (-2, -2), (2, -2)]
    fields["lasers"] |= {"directions_deg": directions, "waist_mm": 2.0, "divergence_mrad": 0.5}
    fields["lasers"] |= lasers or {}
    fields["tof"]["detector"] |= {"field_of_view_deg": tof_fov_deg}
    return Instrument.model_validate(fields)


def depths(one, depth_m=WALL_M):
    """A wall across the optical axis, as ground truth of it."""
    return SimpleNamespace(
        depth_m=np.full(one.projector.shape, depth_m),
        spot_range_m=depth_m / one.lasers.directions[:, 2],
    )


def drops(one, falling, seed=0, fog_per_m=0.0, frames=1):
    position = worlds.scene(worlds.plane(WALL_M), extinction_per_m=fog_per_m)
    scene = replace(position, precipitation=(falling,))
    return falling_drops(scene, one, [depths(one)], frames, np.random.default_rng(seed))


def one_drop(one, position_m, diameter_mm, **options):
    """A single drop that hangs in the air."""
    (all_of_them,) = drops(one, rain(10.0, near_m=0.05, far_m=0.2), **options)
    field = all_of_them.field
    hanging = replace(
        field,
        starts_m=np.array([position_m], float),
        velocities_m_s=np.zeros((1, 3)),
        diameters_mm=np.array([diameter_mm], float),
        box=np.array([[-9.0, -9.0, -9.0], [9.0, 9.0, 9.0]]),
    )
    return (replace(all_of_them, field=hanging, precipitation=rain(10.0)),)


def one_exposure(one, falling, pictures, electrons):
    """Change (windows,) of the exposure that shows all pixels."""
    still = LightSequence(np.zeros(1), ()).between(np.zeros((1, one.pattern_plan.exposures)))
    windows = np.asarray(pictures)[:, None]
    return on_buckets(
        falling, windows, still, electrons, lambda length: np.ones((len(windows), len(length)))
    )[:, 0, 0]


def pixel_rays(one, fine=1):
    """Rays (n, 3) of depth 1 through the centres of pixels, or of their parts."""
    projector = one.projector
    height, width = (side * fine for side in projector.shape)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * projector.tan_half_width
    y = (2 * (np.arange(height) + 0.5) / height - 1) * projector.tan_half_height
    return np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1).reshape(-1, 3)
