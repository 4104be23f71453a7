"""Light that meets a mirror next to both ends: seen in it, and mirrored straight back."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from mitsuba_reference import Renderer

import worlds
from spisim.scene import Material, SceneObject
from spisim.scene.bsdf import Mirror, Plastic, ThinPane
from spisim.transport.backend import activate
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.estimator import transport_image
from spisim.transport.engine.sampling import PathBudget, TransportWarning
from spisim.transport.glints import warn_of_glints
from spisim.transport.mirrors import _Planes
from spisim.transport.world import build_world

activate()
import drjit as dr  # noqa: E402 - the variant comes first
import mitsuba as mi  # noqa: E402

SEEDS = worlds.seeds(8)
REFLECTANCE = 0.9
MIRROR = Material("mirror", REFLECTANCE, "test", Mirror())
VIEW = worlds.projector(shape=(8, 8))
NEAR = worlds.detector([0.05, 0.02, 0.0], area_m2=1e-5, half_angle_deg=20)


def mirror(distance_m: float, tilt_rad: float, half_size_m: float, material=MIRROR) -> SceneObject:
    return replace(
        worlds.plane(distance_m, tilt_rad=tilt_rad, half_size_m=half_size_m), material=material
    )


def test_what_a_mirror_shows_is_the_mirrored_scene() -> None:
    """A wall and a ball beside, seen in a mirror at 45°, and in their images' places without it.

    Light scattered once: the mirror also shows them to each other.
    """
    wall = worlds.surface("wall", trimesh.creation.box((0.1, 6, 6)), 0.6)
    wall.mesh.apply_translation((-4, 0, 3))
    ball = worlds.surface("ball", trimesh.creation.icosphere(3, 0.5), 0.8)
    ball.mesh.apply_translation((-2.6, 0.2, 3.2))
    fold = mirror(3.0, np.pi / 4, 2.0)
    (normal, *_), (corner, *_) = fold.mesh.face_normals, fold.mesh.vertices
    image = np.eye(4)
    image[:3, :3] -= 2 * np.outer(normal, normal)
    image[:3, 3] = 2 * (corner @ normal) * normal
    behind = [
        replace(thing, mesh=thing.mesh.copy().apply_transform(image)) for thing in (wall, ball)
    ]
    folded = build_world(worlds.scene(wall, ball, fold))
    unfolded = build_world(worlds.scene(*behind))
    seen, there = (
        np.array([worlds.image(world, VIEW, NEAR, 256, s, max_vertices=maximum) for s in SEEDS])
        for world, maximum in ((folded, 2), (unfolded, 1))
    )
    expected = REFLECTANCE**2 * there.mean(axis=0)
    assert (expected > 0).all()
    np.testing.assert_allclose(seen.mean(axis=0), expected, rtol=0.02, atol=0)  # edges of the ball
    assert seen.mean(axis=0).sum() == pytest.approx(expected.sum(), rel=1e-3, abs=0)


@pytest.mark.parametrize("bsdf", [Mirror(), ThinPane(1.5)], ids=["mirror", "pane"])
def test_a_mirror_throws_the_projector_back(bsdf) -> None:
    """Σ T = R W_P A cosθ / d²: straight from the projector to the detector's image."""
    material = Material("m", REFLECTANCE, "test", bsdf)
    fold = mirror(2.0, 0.0, 3.0, material)
    image = worlds.image(build_world(worlds.scene(fold)), VIEW, NEAR, 64, SEEDS[0])
    aside = np.hypot(0.05, 0.02)
    squared = 4.0**2 + aside**2
    cosine = 4.0 / np.sqrt(squared)
    once = 0.04
    reflectance = REFLECTANCE if isinstance(bsdf, Mirror) else 2 * once / (1 + once)
    closed = reflectance * 1e-5 * cosine / (VIEW.pixel_area * cosine**3 * squared)
    assert image.sum() == pytest.approx(closed, rel=1e-3, abs=0)
    assert np.count_nonzero(image) == 1


def test_absorbing_air_weakens_what_a_mirror_throws_back_by_the_whole_way() -> None:
    """Also where another mirror, hidden here behind the first, might have been on that way."""
    things = mirror(2.0, 0.0, 3.0), mirror(9.0, 0.0, 3.0)
    absorbing = {"extinction_per_m": 0.2, "albedo": 0.0}
    clear, weak = (
        np.mean([worlds.image(world, VIEW, NEAR, 64, seed).sum() for seed in SEEDS])
        for world in (
            build_world(worlds.scene(*things)),
            build_world(worlds.scene(*things, **absorbing)),
        )
    )
    way_m = np.sqrt(4.0**2 + 0.05**2 + 0.02**2)
    assert weak / clear == pytest.approx(np.exp(-0.2 * way_m), rel=1e-3)


def roof(distance_m: float, half_size_m: float) -> tuple[SceneObject, SceneObject]:
    """Two mirrors at right angles, whose edge is far: z = distance - |x|."""
    return tuple(mirror(distance_m, side * np.pi / 4, half_size_m) for side in (-1, 1))


def test_two_mirrors_in_a_row_throw_the_projector_back() -> None:
    """The detector's image in both is its reflection about their edge."""
    world = build_world(worlds.scene(*roof(2.0, 3.0)))
    images = np.array([worlds.image(world, VIEW, NEAR, 64, seed) for seed in SEEDS])
    squared = 4.0**2 + 0.05**2 + 0.02**2
    cosine2 = 4.0**2 / squared
    closed = REFLECTANCE**2 * 1e-5 / (VIEW.pixel_area * cosine2 * squared)
    assert images.sum(axis=(1, 2)).mean() == pytest.approx(closed, rel=0.01, abs=0)
    assert np.count_nonzero(images.sum(axis=0)) == 1


def column(sides: int = 12) -> SceneObject:
    """A polished column beside the ball of the room."""
    mesh = trimesh.creation.cylinder(0.3, 2.0, sections=sides)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    mesh.apply_translation((0.1, 0.0, 3.6))
    return SceneObject("column", mesh, MIRROR)


def test_planes_that_are_passed_over_show_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Light that meets the column next to both ends, with every plane tried at every vertex."""
    world = build_world(worlds.scene(*worlds.room(), column(24)))

    def images() -> np.ndarray:
        # Apart from this light the images are the same path by path.
        return np.array([worlds.image(world, VIEW, NEAR, 256, seed) for seed in SEEDS])

    result = images()
    monkeypatch.setattr(_Planes, "shows", lambda *arguments: mi.Bool(True))
    every = images()
    monkeypatch.setattr(_Planes, "shows", lambda *arguments: mi.Bool(False))
    none = images()
    assert abs(worlds.z_score(result.sum(axis=(1, 2)), every.sum(axis=(1, 2)))) < 4
    assert np.all(np.abs(worlds.z_score(result, every)[result.mean(axis=0) > 0]) < 5)
    assert worlds.z_score(result.sum(axis=(1, 2)), none.sum(axis=(1, 2))) > 5


def test_errors_of_what_mirrors_show_are_as_told() -> None:
    """Estimates side by side each get their share of the light that only the mirror brings."""
    world = build_world(worlds.scene(*worlds.room(), mirror(3.0, 0.3, 0.7)))
    estimates = [
        transport_image(world, VIEW, NEAR, PathBudget(8), seed=seed) for seed in worlds.seeds(24)
    ]
    scatter = np.var([each.mean["image"] for each in estimates], axis=0, ddof=1).sum()
    messages = np.mean([each.error["image"] ** 2 for each in estimates], axis=0).sum()
    assert scatter / messages == pytest.approx(1, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "mirrors",
    [(mirror(3.0, 0.3, 0.7),), roof(3.0, 0.7), (column(),)],
    ids=["one", "two", "column"],
)
def test_a_room_with_mirrors_in_fog_against_the_reference_engine(mirrors) -> None:
    """Mitsuba follows paths from the projector until they meet a lamp in the detector's place.

    It connects to the lamp, and meets it by chance where a mirror is in between: the lamp is large.
    """
    radius_m = 0.2
    end = worlds.detector([0.25, 0, 0.5], area_m2=np.pi * radius_m**2)
    room = worlds.scene(*worlds.room(), *mirrors, volumes=worlds.bank(0.1, 0.95, 0.7))
    ours = [worlds.image(build_world(room), VIEW, end, 2048, seed) for seed in SEEDS]
    position = mi.ScalarTransform4f().translate([0.25, 0, 0.5]).scale(radius_m)
    lamp = {
        "type": "disk",
        "to_world": position,
        "bsdf": {"type": "null"},
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
    }
    renderer, samples = Renderer(room, {"lamp": lamp}), 2**12
    source = Projector.of(VIEW, samples)
    theirs = []
    for seed in range(len(SEEDS)):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(dr.opaque(mi.UInt32, seed), source.lanes)
        ray, _ = source.pencil(dr.arange(mi.UInt32, source.lanes), sampler)
        radiance = renderer.radiance(ray.o, ray.d, sampler).numpy()
        theirs.append(radiance.reshape(samples, *VIEW.shape).mean(axis=0))
    assert np.all(np.abs(worlds.z_score(ours, theirs)) < 5)
    totals = [np.sum(runs, axis=(1, 2)) for runs in (ours, theirs)]
    assert abs(worlds.z_score(*totals)) < 4
    assert all(total.std() < 0.05 * total.mean() for total in totals)


@pytest.mark.parametrize(
    ("tilt_rad", "material"),
    [
        (0.0, MIRROR),
        (0.02, MIRROR),
        (0.06, MIRROR),
        (0.02, Material("gloss", 0.5, "test", Plastic())),
    ],
)
def test_a_laser_that_is_mirrored_straight_back_is_told(tilt_rad, material, recwarn) -> None:
    """The first of two beams comes back 2 m · tan(2 tilt) aside, 8 mm wide."""
    lasers = replace(worlds.beams([0, 0, 1], [0.2, 0, 1]), divergence_rad=2e-3, waist_m=1e-3)
    position = [-2.0 * np.tan(0.04), 0, 0]  # where the tilt of 0.02 takes it
    apertures = worlds.detector([position, position], half_angle_deg=20)
    world = build_world(worlds.scene(mirror(2.0, tilt_rad, 3.0, material)))
    warn_of_glints(world, lasers, apertures)
    reported = [str(each.message) for each in recwarn if each.category is TransportWarning]
    assert bool(reported) == (tilt_rad == 0.02)
    assert all("spot 0 straight into its detector" in each for each in reported)


def test_a_mirror_of_many_triangles_is_one_plane() -> None:
    """Askew, so that rounding tells its triangles apart."""
    plain = mirror(2.0, 0.01, 3.0)
    turn = trimesh.transformations.rotation_matrix(0.003, [1, 0, 0], [0, 0, 2])
    plain.mesh.apply_transform(turn)
    fine = replace(plain, mesh=plain.mesh.subdivide().subdivide().subdivide())
    view = worlds.projector(30, shape=(8, 8))
    whole, parts = (
        worlds.image(build_world(worlds.scene(thing)), view, NEAR, 64, SEEDS[0])
        for thing in (plain, fine)
    )
    assert len(build_world(worlds.scene(fine)).mirrors.all.offsets_m) == 1
    assert parts.sum() == pytest.approx(whole.sum(), rel=1e-3, abs=0)


def test_no_mirror_costs_nothing() -> None:
    assert build_world(worlds.scene(*worlds.room())).mirrors is None
