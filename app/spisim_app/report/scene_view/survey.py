"""What a scene contains, and at which distances."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument, needs
from spisim.scene import Scene
from spisim.scene.layout import Layout
from spisim.transport import RayCaster

from .cameras import perspective_rays

#: Rays across the projector's field along each axis.
RAYS = 128


@dataclass(frozen=True)
class Spot:
    """A hit point: its range in metres, inf for none, and the object there."""

    range_m: float
    object: str | None


@dataclass(frozen=True, eq=False)
class Survey:
    """Distances in metres from the pinhole over the projector's field, counts, media and lamps.

    `nearest` and `farthest` are in the projector's field, and `points_m` (n, 3) are the hit points
    in the world. `lost` gives the reason for each spot without a range, and `problem` that for
    which the scene is unusable with the instrument, or None.
    """

    name: str
    nearest: Spot
    farthest: Spot
    spots: tuple[Spot, ...]
    clearance_m: float
    extents_m: tuple[float, float, float]
    objects: int
    triangles: int
    media: list[dict[str, Any]]
    lamps: list[dict[str, Any]]
    lost: dict[int, str]
    problem: str | None
    points_m: Floats
    nearest_m: Floats  # (3,); nan if nothing is hit

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready summary."""
        fields = asdict(self)
        return {name: fields[name] for name in fields if name not in ("points_m", "nearest_m")}


def survey(scene: Scene, instrument: Instrument, caster: RayCaster) -> Survey:
    """Look around from the drone; `caster` is of the scene as it is."""
    origin, rotation = scene.drone_pose[:3, 3], scene.drone_pose[:3, :3]
    projector = instrument.imaging.projector
    rays = perspective_rays(
        scene.drone_pose, (RAYS, RAYS), projector.tan_half_width, projector.tan_half_height
    )
    field = caster.along(*rays)
    beams = instrument.ranging.lasers.directions @ rotation.T
    spots = caster.along(np.broadcast_to(origin, beams.shape), beams)
    names = [thing.name for thing in scene.objects]

    def spot_at(range_m: float, number: int) -> Spot:
        return Spot(float(range_m), names[number] if number >= 0 else None)

    hit = np.isfinite(field.range_m)
    near = int(np.argmin(field.range_m))
    far = int(np.argmax(np.where(hit, field.range_m, -np.inf)))
    points = origin + field.range_m[hit, None] * rays[1][hit]
    bounds = np.array([thing.mesh.bounds for thing in scene.objects])
    extents = np.round(bounds[:, 1].max(axis=0) - bounds[:, 0].min(axis=0), 9)  # rounding
    layout = Layout(scene, needs(instrument))
    return Survey(
        name=scene.name,
        nearest=spot_at(field.range_m[near], field.object_id[near]),
        farthest=spot_at(field.range_m[far], field.object_id[far]),
        spots=tuple(map(spot_at, spots.range_m, spots.object_id)),
        clearance_m=layout.clearance_m,
        extents_m=(float(extents[0]), float(extents[1]), float(extents[2])),
        objects=len(scene.objects),
        triangles=sum(len(thing.mesh.faces) for thing in scene.objects),
        media=scene.media_summary(),
        lamps=[lamp.summary() for lamp in scene.lamps],
        lost=layout.lost,
        problem=layout.problem,
        points_m=points,
        nearest_m=origin + field.range_m[near] * rays[1][near] if hit.any() else np.full(3, np.nan),
    )
