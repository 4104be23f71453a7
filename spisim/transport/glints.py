"""Lasers that mirrors reflect straight into their detectors: light that the transport omits."""

import warnings

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.instrument.views import BeamView, DetectorView
from spisim.transport.engine.sampling import TransportWarning
from spisim.transport.geometry import rays_of
from spisim.transport.jit import Hit
from spisim.transport.world import World

#: Maximum number of mirrors and panes along a beam.
MAX_MIRRORS = 4
#: A Gaussian beam counts as this many standard deviations wide.
BEAM_SIGMAS = 3.0


def warn_of_glints(world: World, beams: BeamView, detectors: DetectorView) -> None:
    """Issue a TransportWarning for beams that mirrors reflect straight into their detectors."""
    if world.smooth is None:
        return
    lasers = np.flatnonzero(mirrored_beams(world, beams, detectors))
    if lasers.size:
        text = ", ".join(map(str, lasers))
        warnings.warn(
            f"mirrors reflect the beam of spot {text} straight into its detector: that light, "
            "which would outshine all other, is left out",
            TransportWarning,
            stacklevel=3,
        )


def mirrored_beams(world: World, beams: BeamView, detectors: DetectorView) -> NDArray[np.bool_]:
    """Whether mirrors throw each beam (beams,), at its width there, onto its aperture."""
    ray = rays_of(beams.origins_m, beams.directions)
    apertures = rays_of(detectors.positions_m, detectors.axes)
    positions, axes = apertures.o, apertures.d
    length_m = mi.Float(0)
    going, hits = dr.full(mi.Bool, True, len(beams.origins_m)), mi.Bool(False)
    aperture_m, cosine = np.sqrt(detectors.area_m2 / np.pi), np.cos(detectors.half_angle_rad)
    for mirrors in range(MAX_MIRRORS + 1):
        si: Hit = world.geometry.scene.ray_intersect(ray, going)
        if mirrors > 0:
            along_m = dr.dot(positions - ray.o, ray.d)
            aside_m = dr.norm(positions - ray(along_m))
            sigma_m = dr.hypot(beams.waist_m, beams.divergence_rad * (length_m + along_m))
            meets = (
                (along_m > 0) & (along_m < si.t) & (aside_m < aperture_m + BEAM_SIGMAS * sigma_m)
            )
            hits |= going & meets & (dr.dot(-ray.d, axes) >= cosine)
        going &= si.is_valid()
        sample, _ = si.bsdf().sample(mi.BSDFContext(), si, mi.Float(0), mi.Point2f(0.5), going)
        going &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaReflection)
        length_m += dr.select(going, si.t, 0)
        ray = dr.select(going, si.spawn_ray(si.to_world(sample.wo)), ray)
    return np.asarray(hits.numpy())
