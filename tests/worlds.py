"""Small worlds with known answers, shared by the tests."""

import numpy as np
import trimesh
from mitsuba_reference import bucket_powers

from spisim.atmosphere import Atmosphere, henyey_greenstein
from spisim.instrument.views import BeamView, DetectorView, ProjectorView
from spisim.scene import Ambient, Material, Scene, SceneObject, Volume
from spisim.transport.engine.estimator import spot_histogram, transport_image
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins

ORIGIN = np.eye(4)  # optical frame = world: x right, y down, z forward


def surface(name, mesh, reflectance):
    return SceneObject(name, mesh, Material(name, reflectance, "test"))


def plane(distance_m, reflectance=0.5, tilt_rad=0.0, half_size_m=60.0):
    """Square across the z axis at `distance_m`, turned about the y axis through (0, 0, z)."""
    s = half_size_m
    mesh = trimesh.Trimesh([[-s, -s, 0], [s, -s, 0], [s, s, 0], [-s, s, 0]], [[0, 1, 2], [0, 2, 3]])
    mesh.apply_transform(trimesh.transformations.rotation_matrix(tilt_rad, [0, 1, 0]))
    mesh.apply_translation([0, 0, distance_m])
    return surface("plane", mesh, reflectance)


def sphere(radius_m, reflectance, subdivisions=5):
    return surface("sphere", trimesh.creation.icosphere(subdivisions, radius_m), reflectance)


def room():
    """A closed room, a box and a ball: interreflection, occlusion, ranges from 3 to 8 m."""
    walls = trimesh.creation.box((6, 6, 12))
    walls.apply_translation((0, 0, 2))
    box = trimesh.creation.box((1, 1, 1))
    box.apply_translation((0.6, 0.3, 5))
    ball = trimesh.creation.icosphere(3, 0.5)
    ball.apply_translation((-0.5, -0.3, 4))
    return surface("walls", walls, 0.5), surface("box", box, 0.8), surface("ball", ball, 0.3)


def scene(*objects, extinction_per_m=0.0, albedo=1.0, g=0.0, ambient=None, volumes=()):
    return Scene(
        name="test",
        objects=objects,
        atmosphere=Atmosphere(extinction_per_m, albedo, henyey_greenstein(g), "test"),
        ambient=ambient or Ambient(),
        drone_pose=ORIGIN,
        volumes=tuple(volumes),
    )


def bank(extinction_per_m, albedo=1.0, g=0.0):
    """Volumes that fill the room with fog from 1 m before the instrument on; none at 0.

    Light of one end has no finite variance in fog that surrounds the other end: a path that
    scatters beside the pinhole carries 1/distance². From 1 m on it is bounded, and means of
    repetitions follow the normal law whatever the seed.
    """
    if extinction_per_m == 0:
        return ()
    fog = Atmosphere(extinction_per_m, albedo, henyey_greenstein(g), "test")
    return (Volume("bank", fog, box_pose((5.9, 5.9, 6.9), (0, 0, 4.45))),)


def box_pose(size_m, centre_m):
    """Matrix that takes the unit cube [0, 1]³ to a box."""
    pose = np.diag([*size_m, 1.0]).astype(float)
    pose[:3, 3] = np.asarray(centre_m) - np.asarray(size_m) / 2
    return pose


def pose_at(position_m):
    """Pose that looks along z from a place."""
    pose = np.eye(4)
    pose[:3, 3] = position_m
    return pose


def projector(fov_deg=20.0, shape=(16, 16), pose=ORIGIN):
    half_width = float(np.tan(np.radians(fov_deg) / 2))
    return ProjectorView(pose, shape, half_width, half_width * shape[0] / shape[1])


def detector(position=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), area_m2=1e-6, half_angle_deg=90.0):
    """One detector, or several where `position` and `axis` have several rows."""
    positions, axes = np.broadcast_arrays(np.atleast_2d(position), np.atleast_2d(axis))
    return DetectorView(
        positions.astype(float),
        axes / np.linalg.norm(axes, axis=1, keepdims=True),
        area_m2,
        float(np.radians(half_angle_deg)),
    )


def beams(*directions, origin=(0.0, 0.0, 0.0)):
    headings = np.array(directions, dtype=float)
    headings /= np.linalg.norm(headings, axis=1, keepdims=True)
    return BeamView(np.broadcast_to(np.array(origin, dtype=float), headings.shape), headings)


def pixel_weights(view, weight, oversampling=16):
    """Integral of `weight(x, y)` over each virtual pixel, image plane at unit distance."""
    height, width = (side * oversampling for side in view.shape)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * view.tan_half_width
    y = (2 * (np.arange(height) + 0.5) / height - 1) * view.tan_half_height
    fine = weight(*np.meshgrid(x, y))
    blocks = fine.reshape(view.shape[0], oversampling, view.shape[1], oversampling)
    return blocks.mean(axis=(1, 3)) * view.pixel_area


def image(world, view, end, spp, seed, **options):
    """Transport image (H, W), in one launch: repetitions with other seeds tell its error."""
    estimate = transport_image(
        world, view, end, PathBudget(spp, min_launches=1), seed=seed, **options
    )
    return estimate.mean["image"].reshape(view.shape)


def histogram(world, lasers, ends, bins, paths, seed, **options):
    """Path-length histograms (beams, bins); `bins` is (count, width in m)."""
    return spot_histogram(
        world,
        lasers,
        ends,
        PathLengthBins(*bins),
        PathBudget(paths, min_launches=1),
        seed=seed,
        **options,
    ).mean["histogram"]


def mitsuba_readings(position, view, ends, patterns, runs, samples):
    """Power on all detectors by Mitsuba's own integrators, (runs, patterns); `runs` is a range."""
    powers = bucket_powers(
        position,
        view,
        ends,
        list(patterns) * len(runs),
        samples=samples,
        seed=runs.start * len(patterns),
    )
    return np.array(list(powers)).reshape(len(runs), len(patterns))


def seeds(count):
    return seeds_of(range(count))


def seeds_of(numbers):
    return [np.random.SeedSequence(entropy) for entropy in numbers]


def z_score(first, second):
    """Of the difference of two means, each given as independent repetitions (seeds, ...)."""
    first, second = np.asarray(first), np.asarray(second)
    variance = first.var(axis=0, ddof=1) / len(first) + second.var(axis=0, ddof=1) / len(second)
    return (first.mean(axis=0) - second.mean(axis=0)) / np.sqrt(variance)


def z_score_exact(repetitions, exact):
    repetitions = np.asarray(repetitions)
    error = repetitions.std(axis=0, ddof=1) / np.sqrt(len(repetitions))
    return (repetitions.mean(axis=0) - exact) / error
