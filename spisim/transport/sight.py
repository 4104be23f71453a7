"""What is seen along rays, past what lets light straight through."""

import drjit as dr
import mitsuba as mi

from spisim.transport.geometry import Geometry, direction_to
from spisim.transport.jit import Float, Hit, Point, Ray, Vector
from spisim.transport.meshes import Meshes


def brightest(
    meshes: Meshes, ray: Ray, end: Point, field: tuple[Point, Vector] | None = None
) -> Hit:
    """The surface on each ray that sends most of its light to `end`, which is near its origin.

    The light passes panes and masks both ways. `end` sees what lies within its `field`: the apex of
    a cone, and its axis over the cosine of half its angle; by default all of the ray does. Where no
    surface scatters any to `end`, it is the one that lets none pass, such as a mirror. Distances
    are those from the ray's origin.
    """
    if not meshes.see_through:
        return meshes.scene.ray_intersect(ray)
    return _brightest(meshes, ray, end, *(field or (ray.o, 2 * ray.d)))


@dr.syntax
def _brightest(meshes: Meshes, ray: Ray, end: Point, apex: Point, axis: Vector) -> Hit:
    context = mi.BSDFContext(mi.TransportMode.Importance)
    result: Hit = dr.zeros(mi.SurfaceInteraction3f, dr.width(ray.d))
    result.t = dr.inf
    most, through, origin = mi.Float(0), mi.Float(1), mi.Point3f(ray.o)
    ray, end, going = mi.Ray3f(ray), mi.Point3f(end), mi.Bool(True)
    apex, axis = mi.Point3f(apex), mi.Vector3f(axis)
    while dr.hint(going, exclude=[meshes, context]):
        si = meshes.scene.ray_intersect(ray, going)
        going &= si.is_valid()
        towards, gap_m = direction_to(si.p, end)
        light = si.bsdf().eval(context, si, si.to_local(towards), going).x
        seen = dr.dot(si.p - apex, axis) >= dr.norm(si.p - apex)
        light *= dr.select(seen, dr.square(through / gap_m), 0)
        passed = si.bsdf().eval_null_transmission(si, going).x
        si.t = dr.norm(si.p - origin)
        better = going & ((light > most) | ((most == 0) & (passed == 0)))
        result = dr.select(better, si, result)
        most = dr.select(better, light, most)
        through *= passed
        ray.o = origin + (si.t + (1 + si.t) * mi.math.RayEpsilon) * ray.d  # not off the ray
        going &= through > 0
    return result


def first_distance_m(meshes: Meshes, ray: Ray) -> Float:
    """Distance along each ray to the first surface that takes any light away; inf for none."""
    onward = ray
    if meshes.see_through:
        geometry = Geometry(meshes.scene, meshes.see_through)
        onward, *_ = geometry.up_to(_takes_light, ray, mi.Bool(True))
    si = meshes.scene.ray_intersect(onward)
    return dr.select(si.is_valid(), dr.norm(si.p - ray.o), dr.inf)


def _takes_light(si: Hit) -> Float:
    return si.bsdf().eval_null_transmission(si, si.is_valid()).x < 1
