"""Fog within closed meshes: closed forms, and the same fog in boxes and balls."""

import mitsuba as mi
import numpy as np
import pytest
import trimesh

import worlds
from spisim.atmosphere import HenyeyGreenstein, explicit
from spisim.scene import Volume
from spisim.transport import world
from spisim.transport.backend import CUDA_VARIANT, activate
from spisim.transport.crossings import MeshTree, TracedMesh
from spisim.transport.world import build_world

SEEDS = worlds.seeds(8)
HG = HenyeyGreenstein(0.7)
BANK = worlds.box_pose((1.5, 2.0, 1.0), (0.1, 0.2, 3.0))
RAYS = 4096


def filled(shape, extinction=0.8, albedo=0.9, density=None, pose=None):
    """A volume of a mesh, and of the box around it."""
    if pose is None:
        low, high = shape.bounds
        pose = worlds.box_pose(high - low, (low + high) / 2)
    return Volume("bank", explicit(extinction, albedo, HG), pose, density, shape=shape)


def as_mesh(pose):
    """A box of 12 triangles where the unit cube is placed."""
    cube = trimesh.creation.box((1, 1, 1))
    cube.apply_translation((0.5, 0.5, 0.5))
    return cube.apply_transform(pose)


def bumps(shape=(5, 4, 6)):
    return np.random.default_rng(0).uniform(0, 1, shape).astype(np.float32)


def medium(volume):
    activate()
    return build_world(worlds.scene(worlds.plane(9.0), volumes=[volume])).media


@pytest.fixture(params=["traced", "tree"], autouse=True)
def closed_mesh(request, monkeypatch):
    """Either form of a mesh: that of CPUs, and that of GPUs, which runs on both."""
    form = {"traced": TracedMesh, "tree": MeshTree}[request.param]
    if form is TracedMesh and activate() == CUDA_VARIANT:
        pytest.skip("kernels on a GPU trace one scene")
    monkeypatch.setattr(world, "closed_mesh", form.of)


def rays(spread=1.0, seed=0):
    """Origins (n, 3) all around, inside and out, unit directions and lengths."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(0, spread, (RAYS, 3))
    directions = rng.normal(size=(RAYS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return origins, directions, rng.exponential(2 * spread, RAYS)


def transmittance(media, origins, directions, far, seed=0):
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, len(far))
    through = media.transmittance(
        mi.Ray3f(mi.Point3f(np.float32(origins.T)), mi.Vector3f(np.float32(directions.T))),
        mi.Float(np.float32(far)),
        sampler,
        mi.Bool(True),
    )
    return through.numpy()


def chord(origins, directions, far, radius):
    """Length within a ball about the origin."""
    middle = -np.sum(origins * directions, axis=1)
    squared = radius**2 - np.sum((origins + middle[:, None] * directions) ** 2, axis=1)
    half = np.sqrt(np.maximum(squared, 0))
    inside = np.minimum(middle + half, far) - np.maximum(middle - half, 0)
    return np.where(squared > 0, np.maximum(inside, 0), 0)


def test_a_box_of_triangles_is_a_box():
    """Transmittances, extinctions, and whether a point is inside."""
    turned = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]) @ BANK
    ours, box = medium(filled(as_mesh(turned), pose=turned)), medium(filled("box", pose=turned))
    origins, directions, far = rays(3.0)
    first, second = (transmittance(each, origins, directions, far) for each in (ours, box))
    np.testing.assert_allclose(first, second, atol=2e-5)
    assert ((second > 0.05) & (second < 0.9)).sum() > 50
    points = mi.Point3f(np.float32(origins.T))
    np.testing.assert_array_equal(ours.extinction_at(points), box.extinction_at(points))


@pytest.mark.parametrize(
    "closed_mesh", ["traced", pytest.param("tree", marks=pytest.mark.slow)], indirect=True
)
@pytest.mark.parametrize("density", [None, bumps()], ids=["homogeneous", "grid"])
def test_light_in_a_box_of_triangles_is_that_in_a_box(density):
    view, end = worlds.projector(shape=(4, 4)), worlds.detector([0.05, 0, 0], half_angle_deg=14)
    runs = []
    for shape in ("box", as_mesh(BANK)):
        position = worlds.scene(*worlds.room(), volumes=[filled(shape, density=density, pose=BANK)])
        built = build_world(position)
        runs.append([worlds.image(built, view, end, 512, seed) for seed in SEEDS])
    score = worlds.z_score(*runs)
    assert np.abs(score).max() < 4
    assert np.sqrt(np.mean(score**2)) < 1.8


def test_chords_of_a_ball():
    """The ball exactly, and its triangles as far as they are round."""
    ball = Volume("ball", explicit(0.8, 0.9, HG), worlds.box_pose((4, 4, 4), (0, 0, 0)),
                  shape="ball")  # fmt: skip
    origins, directions, far = rays()
    closed = np.exp(-0.8 * chord(origins, directions, far, 2.0))
    np.testing.assert_allclose(
        transmittance(medium(ball), origins, directions, far), closed, atol=2e-5
    )
    mesh = trimesh.creation.icosphere(5, 2.0)
    result = transmittance(medium(filled(mesh)), origins, directions, far)
    assert np.quantile(np.abs(result - closed), 0.99) < 0.01
    assert np.abs(result - closed).mean() < 1e-3


def test_a_hollow_ball_is_the_difference_of_two():
    """A shell that faces in, within one that faces out: neither convex nor connected."""
    outer, inner = trimesh.creation.icosphere(5, 2.0), trimesh.creation.icosphere(5, 1.0)
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    origins, directions, far = rays()
    lengths = [chord(origins, directions, far, radius) for radius in (2.0, 1.0)]
    closed = np.exp(-0.8 * (lengths[0] - lengths[1]))
    result = transmittance(medium(filled(hollow)), origins, directions, far)
    assert np.abs(result - closed).mean() < 2e-3
    assert np.quantile(np.abs(result - closed), 0.99) < 0.02


@pytest.mark.parametrize("density", [None, bumps()], ids=["homogeneous", "grid"])
def test_flights_end_as_often_as_light_does(density):
    """Of flights along one ray through a hollow ball, from inside of its shell."""
    outer, inner = trimesh.creation.icosphere(4, 2.0), trimesh.creation.icosphere(4, 1.0)
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])
    media, count = medium(filled(hollow, 0.6, density=density)), 2**17
    origin, direction = np.array([0.1, -1.6, 0.2]), np.array([0.05, 0.99, 0.03])
    direction /= np.linalg.norm(direction)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, count)
    ray = mi.Ray3f(mi.Point3f(*origin.tolist()), mi.Vector3f(*direction.tolist()))
    distance = media.flight(ray, mi.Float(10.0), sampler, mi.Bool(True)).distance.numpy()
    edges = np.array([0.3, 0.7, 1.6, 2.65, 3.2, 10.0])
    many = np.broadcast_to(edges, (2**14, len(edges))).ravel()
    ways = [np.broadcast_to(each, (len(many), 3)) for each in (origin, direction)]
    through = transmittance(media, *ways, many).reshape(-1, len(edges))
    given, error = through.mean(axis=0), through.std(axis=0) / np.sqrt(len(through))
    survived = np.array([(distance > edge).mean() for edge in edges])
    noise = np.hypot(np.sqrt(survived * (1 - survived) / count), error)
    assert np.all(np.abs(survived - given) < 4 * noise + 1e-7)
    assert survived[2] == pytest.approx(survived[1], abs=0.02)  # in the hollow
    assert survived[-1] < 0.7


def test_rays_at_edges_cross_one_of_both_triangles():
    """The winding number is a whole one, and that of the point."""
    activate()
    mesh = trimesh.creation.icosphere(3, 2.0)
    tree = MeshTree.of(mesh)
    for origin, wraps in ((np.array([3.0, 0.5, -4.0]), 0.0), (np.array([0.3, 0.2, 0.1]), 1.0)):
        corners = mesh.vertices[mesh.edges_unique]  # (edges, 2, 3)
        directions = (corners[:, 0] * 0.4 + corners[:, 1] * 0.6) - origin
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        towards = mi.Vector3f(np.asarray(directions.T, dtype=np.float32))
        ray = mi.Ray3f(mi.Point3f(*origin.tolist()), towards)
        winding, _ = tree.sums(ray, mi.Float(10.0), mi.Bool(True))
        np.testing.assert_array_equal(winding.numpy(), wraps)
