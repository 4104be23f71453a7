"""The lamps of a scene as the light transport takes them, in watts within the band."""

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.scene.lamps import AreaLamp, DirectionalLamp, EnvironmentLamp, PointLamp, solid_angle
from spisim.transport.engine.lamps import Areas, Lamps, Parallel, Points, Surround, Uniform
from spisim.transport.meshes import Meshes
from spisim.transport.world import World


def lamps_of(scene: Scene, instrument: Instrument, world: World) -> Lamps | None:
    """All lamps; None where there are none."""
    if not scene.lamps:
        return None
    return lamps_in_band(scene, instrument.daylight_irradiance(1.0), world)


def lamps_in_band(scene: Scene, watts_per_klm: float, world: World) -> Lamps:
    """All lamps, with the watts in the band that each kilolumen counts for."""
    far_m = 3 * world.radius_m
    around: list[Uniform | Surround] = []
    parallel: list[Parallel] = []
    for lamp in scene.lamps:
        match lamp:
            case DirectionalLamp():
                parallel.append(
                    Parallel(
                        dr.opaque(mi.Float, lamp.irradiance.in_band(watts_per_klm)),
                        dr.opaque(mi.Vector3f, list(lamp.direction)),
                        dr.opaque(mi.Float, far_m),
                    )
                )
            case EnvironmentLamp(picture=picture):
                radiance = lamp.radiance.in_band(watts_per_klm)
                if picture is None:
                    around.append(Uniform(dr.opaque(mi.Float, radiance)))
                else:
                    around.append(Surround.of(radiance * picture, lamp.to_world, far_m))
    points = [lamp for lamp in scene.lamps if isinstance(lamp, PointLamp)]
    areas = [lamp for lamp in scene.lamps if isinstance(lamp, AreaLamp)]
    return Lamps(
        tuple(parallel),
        _points(points, watts_per_klm) if points else None,
        _areas(scene, areas, watts_per_klm) if areas else None,
        tuple(around),
    )


def _points(lamps: Sequence[PointLamp], watts_per_klm: float) -> Points:
    angles = np.array([(lamp.beam_rad, lamp.cutoff_rad) for lamp in lamps])
    intensities = np.array([lamp.intensity.in_band(watts_per_klm) for lamp in lamps])
    spreads = np.array([solid_angle(cutoff, beam) for beam, cutoff in angles])
    return Points.of(
        np.array([lamp.position_m for lamp in lamps]),
        np.array([lamp.direction for lamp in lamps]),
        intensities,
        angles,
        intensities * spreads,
    )


def _areas(scene: Scene, lamps: Sequence[AreaLamp], watts_per_klm: float) -> Areas:
    """Several lamps on one object add up."""
    meshes = Meshes.of(scene.objects)
    radiances = np.zeros(meshes.triangles, dtype=np.float32)
    corners = np.zeros((meshes.triangles, 3, 3))
    numbers = {thing.name: number for number, thing in enumerate(scene.objects)}
    for lamp in lamps:
        number = numbers[lamp.object]
        part = meshes.triangles_of(number)
        radiances[part] += lamp.radiance.in_band(watts_per_klm)
        corners[part] = scene.objects[number].mesh.triangles
    return Areas.of(meshes, radiances, corners[radiances > 0])
