"""A scene as Mitsuba holds it: meshes with their materials, mirrors, and media."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.atmosphere import Atmosphere
from spisim.instrument.views import BeamView
from spisim.scene import Scene, Volume
from spisim.scene.bsdf import Diffuse, Retroreflector
from spisim.scene.lamps import PointLamp
from spisim.transport.backend import with_backend
from spisim.transport.bounds import Ball, Bounds, Box, Ellipsoid
from spisim.transport.crossings import closed_mesh
from spisim.transport.enclosed import Enclosed
from spisim.transport.geometry import Geometry, rays_of, transform
from spisim.transport.jit import Bool, Float, Hit, Object, Ray, Sampler, Vector
from spisim.transport.media import (
    Bias,
    Grid,
    Homogeneous,
    Media,
    Medium,
    density_texture,
    phase_plugin,
)
from spisim.transport.meshes import Meshes
from spisim.transport.mirrors import Mirrors, mirrors_of
from spisim.transport.scores import Parameter, Scored, Tracked

#: Fog extends this far beyond the scene: light scattered further out does not come back.
FOG_MARGIN_M = 15.0
#: Nor does light from this optical depth: if the horizon is farther, fog and its effect on daylight
#: end there.
FOG_DEPTHS = 10.0


@dataclass(frozen=True, eq=False)
class World:
    """Surfaces and media, ready to be traced."""

    geometry: Geometry
    media: Media
    mirrors: Mirrors | None  # smooth metal, glass and panes, too
    smooth: Mirrors | None  # these, and smooth coats
    radius_m: float  # of a ball around everything
    diffuse: bool  # all surfaces are Lambertian
    retroreflects: bool  # some surface does
    tracked: Tracked

    @property
    def plain(self) -> bool:
        """Clear air and diffuse surfaces: paths from the pixels alone find all light best."""
        return self.diffuse and not self.media.parts

    @property
    def hazy(self) -> bool:
        """Fog, and surfaces none of which lets light straight through."""
        return bool(self.media.parts) and not self.geometry.see_through

    def first_surface(self, ray: Ray) -> tuple[Hit, Float]:
        """First surface on a ray and the distance to it; twice the radius if there is none."""
        si = self.geometry.scene.ray_intersect(ray)
        return si, dr.select(si.is_valid(), si.t, dr.opaque(mi.Float, 2 * self.radius_m))

    def transmittance(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Scored:
        """Fraction of light that gets `far` without a collision."""
        through = self.media.transmittance(ray, far, sampler, active)
        return Scored(through, self.tracked.along(ray, far, sampler, active))

    def reflected(self, context: Object, si: Hit, towards: Vector, active: Bool) -> Scored:
        """BSDF x cosine towards a direction (unit vector)."""
        local = si.to_local(towards)
        value = si.bsdf().eval(context, si, local, active).x
        return Scored(value, self.tracked.reflected(context, si, local, value, active))

    def axis_distances_m(self, beams: BeamView) -> Floats:
        """Distances along the axes of beams to all surfaces, past what lets light through, (n,)."""
        ray, gone_m = rays_of(beams.origins_m, beams.directions), np.zeros(len(beams.directions))
        result = [np.zeros(0)]
        while len(gone_m):
            si = self.geometry.scene.ray_intersect(ray)
            passed = si.bsdf().eval_null_transmission(si, si.is_valid()).x.numpy()
            gone_m = gone_m + si.t.numpy()
            met = si.is_valid().numpy()
            result.append(gone_m[met])
            onward = np.flatnonzero(met & (passed > 0))
            ray = dr.gather(mi.Ray3f, si.spawn_ray(ray.d), mi.UInt32(onward))
            gone_m = gone_m[onward]
        return np.concatenate(result)


@with_backend
def build_world(scene: Scene, tracked: Mapping[str, Parameter] = MappingProxyType({})) -> World:
    """Convert a scene to Mitsuba; paths keep the scores of the parameters that are `tracked`."""
    meshes, (mirrors, smooth) = Meshes.of(scene.objects), mirrors_of(scene.objects)
    media = _media(scene)
    return World(
        geometry=Geometry(meshes.scene, meshes.see_through),
        media=media,
        mirrors=mirrors,
        smooth=smooth,
        radius_m=_everything(scene)[1],
        diffuse=all(isinstance(thing.material.bsdf, Diffuse) for thing in scene.objects),
        retroreflects=any(isinstance(each.material.bsdf, Retroreflector) for each in scene.objects),
        tracked=Tracked.of(tracked, media, meshes, scene.objects),
    )


def _media(scene: Scene) -> Media:
    """Fog everywhere, and the volumes besides."""
    parts: list[Medium] = []
    if scene.atmosphere.extinction_per_m > 0:
        centre, radius_m = fog_ball(scene)
        ball = Ball(dr.opaque(mi.Point3f, centre.tolist()), dr.opaque(mi.Float, radius_m))
        parts.append(_homogeneous(ball, scene.atmosphere))
    return Media((*parts, *map(_filled, scene.volumes)))


def _filled(volume: Volume) -> Medium:
    """The medium of a volume."""
    to_local = transform(np.linalg.inv(volume.to_world))
    bounds: Bounds = Ellipsoid(to_local) if volume.shape == "ball" else Box(to_local)
    grid = None
    if volume.density is not None:
        peak = float(volume.density.max())
        thickest = replace(volume.medium, extinction_per_m=volume.medium.extinction_per_m * peak)
        texture = density_texture(volume.density / peak)
        grid = Grid(Box(to_local), texture, *_optics(thickest), bounds)
    if not isinstance(volume.shape, str):
        optics = _optics(volume.medium if grid is None else thickest)
        return Enclosed(closed_mesh(volume.shape), *optics, grid)
    return grid or _homogeneous(bounds, volume.medium)


def _homogeneous(bounds: Bounds, medium: Atmosphere) -> Homogeneous:
    return Homogeneous(bounds, *_optics(medium), Bias.of(medium.extinction_per_m))


def _optics(medium: Atmosphere) -> tuple[Float, Float, Object]:
    """Extinction, albedo and phase function as the tracer takes them."""
    return (
        dr.opaque(mi.Float, medium.extinction_per_m),
        dr.opaque(mi.Float, medium.albedo),
        phase_plugin(medium.phase),
    )


def fog_ball(scene: Scene) -> tuple[Floats, float]:
    """Centre (3,) and radius, in metres, of the ball that the fog fills."""
    centre, radius_m = _everything(scene)
    extinction_per_m = scene.atmosphere.extinction_per_m
    if extinction_per_m * radius_m <= FOG_DEPTHS:
        return centre, radius_m
    return scene.drone_pose[:3, 3], FOG_DEPTHS / extinction_per_m


def _everything(scene: Scene) -> tuple[Floats, float]:
    """Centre (3,) and radius of a ball around all surfaces, lamps and the instrument, in metres."""
    corners = [thing.mesh.bounds for thing in scene.objects] + [scene.drone_pose[None, :3, 3]]
    corners += [np.array([each.position_m]) for each in scene.lamps if isinstance(each, PointLamp)]
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, float(np.linalg.norm(high - low) / 2 + FOG_MARGIN_M)
