"""Derivatives by materials and media, from the paths of one pass.

A wall alone returns light in proportion to its reflectance, a white shell in proportion to a known
series. Everything else is held against differences of passes with the same random numbers through
scenes that differ by a little: |z| < 4 over the cells, whose light is independent.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh

import spisim
import worlds
from spisim.scene import Ambient, Material, Volume
from spisim.scene.bsdf import (
    DIFFUSE,
    Conductor,
    Mirror,
    Plastic,
    Principled,
    Retroreflector,
    RoughConductor,
    RoughPlastic,
    ThinPane,
)
from spisim.scene.lamps import PointLamp, Strength
from spisim.transport.daylight import daylight_power, projector_power
from spisim.transport.engine.estimator import Strategy, spot_histogram, transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.path_weights import Score, tracked_by
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.scores import Albedo, Asymmetry, Extinction, Reflectance
from spisim.transport.world import build_world

SEED = np.random.SeedSequence(3)
VIEW = worlds.projector(shape=(8, 8))
END = worlds.detector((0.1, 0, 0), half_angle_deg=12)
LASERS = worlds.beams(*([x, y, 8] for x in range(-2, 2) for y in range(-2, 2)))
EYES = worlds.detector(np.full((16, 3), [0.1, 0, 0]), half_angle_deg=40)
PAPER = spisim.load_instrument("paper")
BANK = worlds.bank(0.08, albedo=0.9, g=0.7)
STEP = 0.01
SAME = 3e-4
"""Relative difference that a step and single precision may make."""

SURFACES = {
    "clear": ((DIFFUSE,) * 3, ()),
    "fog": ((DIFFUSE,) * 3, BANK),
    "gloss": ((Principled(0.4), Plastic(1.5), Retroreflector(0.1, 0.2)), ()),
    "gloss in fog": ((DIFFUSE, RoughPlastic(0.3), Plastic(1.5)), BANK),
    "metal": ((DIFFUSE, Mirror(), RoughConductor(0.3, 1.0, 9.0)), ()),
    "metal in fog": ((Principled(0.5, metallic=1.0), Conductor(1.0, 9.0), DIFFUSE), BANK),
}


def some_slow(*names, fast):
    return [name if name == fast else pytest.param(name, marks=pytest.mark.slow) for name in names]


@cache
def room(name, *, mirror=False, pane=False, volumes=()):
    """The room with surfaces; with a mirror at its side, and a pane across."""
    bsdfs, bank = SURFACES[name]
    things = [
        painted(thing, thing.name, bsdf) for thing, bsdf in zip(worlds.room(), bsdfs, strict=True)
    ]
    if mirror:
        side = worlds.plane(0.0, 0.8, tilt_rad=np.pi / 2, half_size_m=2.0)
        side.mesh.apply_translation((2.0, 0, 4.0))
        things.append(painted(side, "mirror", Mirror()))
    if pane:
        glass = Material("pane", 0.08, "test", ThinPane(1.5))
        things.append(replace(worlds.plane(2.0, half_size_m=1.5), name="pane", material=glass))
    return worlds.scene(*things, volumes=(*bank, *volumes))


def painted(thing, name, bsdf, factor=1.0):
    """With this surface and a factor on its reflectance: that of a metal by a picture."""
    metal = isinstance(bsdf, Conductor | RoughConductor)
    texture = np.full((1, 1), 0.9 * (factor if metal else 1.0), np.float32)
    reflectance = thing.material.reflectance * (1.0 if metal else factor)
    material = Material(name, reflectance, "test", bsdf, texture)
    mesh = thing.mesh.copy()
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(mesh.vertices), 2)))
    return replace(thing, name=name, mesh=mesh, material=material)


def changed(scene, steps):
    """The scene with parameters multiplied by 1 + step, or, asymmetries, moved by it."""
    things, media = list(scene.objects), [scene.atmosphere, *(v.medium for v in scene.volumes)]
    first = 0 if scene.atmosphere.extinction_per_m > 0 else 1
    for parameter, step in steps.items():
        if isinstance(parameter, Reflectance):
            (number,) = (k for k, thing in enumerate(things) if thing.name == parameter.material)
            thing = things[number]
            things[number] = painted(thing, thing.name, thing.material.bsdf, 1 + step)
            continue
        number = parameter.medium + first
        medium = media[number]
        match parameter:
            case Extinction():
                new = {"extinction_per_m": medium.extinction_per_m * (1 + step)}
            case Albedo():
                new = {"albedo": medium.albedo * (1 + step)}
            case Asymmetry():
                new = {"phase": replace(medium.phase, g=medium.phase.g + step)}
        media[number] = replace(medium, **new)
    volumes = [replace(v, medium=m) for v, m in zip(scene.volumes, media[1:], strict=True)]
    return replace(scene, objects=tuple(things), atmosphere=media[0], volumes=tuple(volumes))


def image(scene, scores=(), spp=128, view=VIEW, end=END, **options):
    """Light of each pixel by order of scattering (3, pixels), and the same by each score."""
    result = transport_image(
        build_world(scene, tracked_by(scores)),
        view,
        end,
        PathBudget(spp, min_launches=1),
        seed=SEED,
        outputs=Outputs(orders=True, weights=tuple(scores)),
        **options,
    ).mean
    return result["image_orders"], [result[f"image_orders_{each.name}"] for each in scores]


def spots(scene, scores=(), paths=2048, **options):
    """The same of lasers, by whether the path is longer than 10 m, (2, lasers)."""
    result = spot_histogram(
        build_world(scene, tracked_by(scores)),
        LASERS,
        EYES,
        PathLengthBins(40, 1.0),
        PathBudget(paths, min_launches=1),
        seed=SEED,
        path_weights=tuple(scores),
        **options,
    ).mean
    light, *sums = (
        np.stack([result[name][:, :11].sum(axis=1), result[name][:, 11:].sum(axis=1)])
        for name in ("histogram", *(f"histogram_{each.name}" for each in scores))
    )
    return light, sums


def steady(scene, scores=(), lit=None):
    """The same of steady light on detectors alike, from a fixed number of paths, (1, detectors)."""
    world = build_world(scene, tracked_by(scores))
    fixed = {"target": 1e9, "seed": SEED, "path_weights": tuple(scores)}
    if lit == "projector":
        received = projector_power(world, VIEW, np.full(VIEW.shape, 1 / 64), EYES, **fixed)
    else:
        received = daylight_power(scene, PAPER, world, EYES, **fixed)
    return received.power_w[None], [received.weighted[each.name][0][None] for each in scores]


def outdoors(scene):
    """Sun and sky over the room without its upper wall, and lamps in it."""
    (walls, *things), up = scene.objects, (0.0, -1.0, 0.0)
    mesh = walls.mesh.copy()
    mesh.update_faces(mesh.face_normals @ up < 0.5)
    return replace(
        scene,
        objects=(replace(walls, mesh=mesh), *things),
        ambient=Ambient(sun_klx=20.0, sky_klx=10.0, sun_direction=(0.0, 0.6, 0.8)),
        lamps=(PointLamp("bulb", (1.0, -1.0, 3.0), Strength(0.3, luminous=False)),),
    )


def scores_of(*parameters):
    return [Score(f"score {number}", each) for number, each in enumerate(parameters)]


def largest_z(trace, scene, *parameters, **options):
    """Of the derivative along 1, 2, 3, … of parameters against a difference, over cells.

    Of all light, and of its parts.
    """
    light, derivatives = trace(scene, scores_of(*parameters), **options)
    weights = {each: weight for weight, each in enumerate(parameters, 1)}
    derivative = sum(w * each for w, each in zip(weights.values(), derivatives, strict=True))
    high, low = (
        trace(changed(scene, {each: sign * STEP * w for each, w in weights.items()}), **options)[0]
        for sign in (1, -1)
    )
    off = derivative - (high - low) / (2 * STEP)
    assert (derivative.sum(axis=1)[light.sum(axis=1) > 0] != 0).all()
    largest = 0.0
    for part in (slice(None), *(slice(number, number + 1) for number in range(len(light)))):
        difference, size = (each[part].sum(axis=0) for each in (off, light))
        error = difference.std(ddof=1) / np.sqrt(difference.size)
        bound = np.hypot(error, SAME * size.mean())
        largest = max(largest, abs(difference.mean()) / bound) if bound > 0 else largest
    return largest


MATERIALS = tuple(Reflectance(name) for name in ("walls", "box", "ball"))


@pytest.mark.parametrize("name", some_slow(*SURFACES, fast="gloss in fog"))
@pytest.mark.parametrize("trace", [image, spots])
def test_light_changes_with_reflectances_as_its_scores_say(trace, name):
    assert largest_z(trace, room(name), *MATERIALS) < 4


@pytest.mark.parametrize("name", some_slow("clear", "fog", "gloss in fog", fast="fog"))
@pytest.mark.parametrize("trace", [image, spots])
def test_mirrors_and_panes_add_to_the_scores(trace, name):
    scene = room(name, mirror=True, pane=True)
    assert largest_z(trace, scene, Reflectance("mirror"), *MATERIALS[:2]) < 4


@pytest.mark.parametrize("filled", some_slow("box", "ball", "mesh", fast="box"))
@pytest.mark.parametrize("trace", [image, spots])
def test_each_medium_has_its_own_scores(trace, filled):
    """A bank of fog and a denser volume in it: paths scatter in either, or in both."""
    scene = room("fog", volumes=(volume(filled),))
    parameters = Extinction(0), Extinction(1), Albedo(1), Asymmetry(1, 0.5)
    assert largest_z(trace, scene, *parameters) < 4


def volume(filled, density=None):
    pose = worlds.box_pose((3, 2, 2), (0.2, 0.1, 3.0))
    mesh = trimesh.creation.box((3, 2, 2), transform=worlds.pose_at((0.2, 0.1, 3.0)))
    medium = worlds.bank(0.3, albedo=0.9, g=0.5)[0].medium
    return Volume(filled, medium, pose, density, shape=mesh if filled == "mesh" else filled)


@pytest.mark.parametrize("filled", some_slow("box", "mesh", fast="box"))
def test_a_gridded_volume_has_the_scores_of_a_uniform_one(filled):
    """Tracked by other random numbers, so that independent cells are compared."""
    scores = scores_of(Extinction(0), Albedo(0), Asymmetry(0, 0.5))
    plain, grid = (
        image(room("clear", volumes=(volume(filled, density),)), scores, 512)[1]
        for density in (None, np.ones((2, 3, 4), np.float32))
    )
    for first, second in zip(plain, grid, strict=True):
        assert abs(worlds.z_score(first.sum(axis=0), second.sum(axis=0))) < 4


@pytest.mark.parametrize("filled", some_slow("box", "ball", "mesh", fast="box"))
def test_a_gridded_volume_darkens_a_wall_by_its_optical_depth(filled):
    """Of a density that rises along the view: light there and back has −2 τ of a derivative."""
    rise = np.linspace(0.2, 1.0, 5, dtype=np.float32)[:, None, None]
    black = replace(volume(filled, rise), medium=replace(volume(filled).medium, albedo=0.0))
    view = worlds.projector(1.0, (8, 8))
    end = worlds.detector((0.0, 0, 0), half_angle_deg=5)
    scene = worlds.scene(worlds.plane(8.0), volumes=(black,))
    light, (derivative,) = image(scene, scores_of(Extinction(0)), 2048, view=view, end=end)
    depth = 0.3 * 2.0 * rise.mean()
    off = (derivative + 2 * depth * light).sum(axis=0)
    assert abs(off.mean()) < 4 * np.hypot(off.std(ddof=1) / 8, 3e-3 * light.sum(axis=0).mean())


def test_the_light_itself_is_untouched_by_scores():
    for scene in (room("gloss"), room("fog")):
        plain, _ = image(scene)
        np.testing.assert_array_equal(plain, image(scene, scores_of(*MATERIALS))[0])


@pytest.mark.parametrize("name", some_slow("clear", "fog", "gloss in fog", fast="fog"))
@pytest.mark.parametrize("lit", ["projector", "daylight", "lamps"])
def test_steady_light_has_derivatives(name, lit):
    scene = outdoors(room(name))
    if lit == "lamps":
        scene = replace(scene, ambient=Ambient())
    parameters = MATERIALS if name == "clear" else (*MATERIALS, Extinction(0), Albedo(0))
    assert largest_z(steady, scene, *parameters, lit=lit) < 4


@pytest.mark.parametrize("strategy", [Strategy.PROJECTOR, Strategy.DETECTOR])
@pytest.mark.parametrize("trace", [image, spots])
def test_each_strategy_alone_keeps_the_same_scores(trace, strategy):
    parameters = Reflectance("walls"), Extinction(0), Albedo(0)
    assert largest_z(trace, room("fog"), *parameters, strategy=strategy) < 4


def test_light_of_a_wall_is_proportional_to_its_reflectance():
    scene = worlds.scene(worlds.plane(4.0, 0.4), extinction_per_m=0.08, albedo=0.0)
    for trace in (image, spots):
        light, (derivative,) = trace(scene, scores_of(Reflectance("plane")))
        np.testing.assert_allclose(derivative, light, rtol=1e-6)
        assert light.sum() > 0


def test_light_in_a_shell_is_that_of_its_series():
    """ρ / (1 − ρ) of all reflections, whose derivative by ln ρ is 1 / (1 − ρ) of the light."""
    reflectance = 0.6
    shell = worlds.scene(worlds.sphere(3.0, reflectance))
    wall = worlds.detector([0.0, 0.0, -2.99])
    light, (derivative,) = image(shell, scores_of(Reflectance("sphere")), 1024, end=wall)
    light, derivative = light.sum(axis=0), derivative.sum(axis=0)
    off = derivative - light / (1 - reflectance)
    assert abs(off.mean()) < 4 * np.hypot(off.std(ddof=1) / 8, 1e-3 * derivative.mean())


def test_objects_share_the_score_of_their_material():
    """One factor on both is the sum of two; surfaces alike of other names have no part in it."""
    rows = zip(worlds.room(), ("other", "paint", "paint"), (0.5, 0.5, 0.7), strict=True)
    shared = [replace(each, material=Material(name, rho, "test")) for each, name, rho in rows]
    apart = [
        replace(each, material=replace(each.material, name=str(k))) for k, each in enumerate(shared)
    ]
    paint, other, none = (Reflectance(name) for name in ("paint", "other", "absent"))
    light, sums = image(worlds.scene(*shared), scores_of(paint, other, none))
    again, (walls, box, ball) = image(
        worlds.scene(*apart), scores_of(*(Reflectance(str(number)) for number in range(3)))
    )
    np.testing.assert_allclose(again, light)
    for result, expected in zip(sums, (box + ball, walls, 0 * walls), strict=True):
        np.testing.assert_allclose(result, expected, rtol=1e-6)


def test_light_by_a_mirror_both_ways_adds_every_reflection():
    """A mirror fills the view: a path meets it first and last, and a wall between."""
    ahead = painted(worlds.plane(2.0, 0.8, tilt_rad=np.pi / 4, half_size_m=1.5), "mirror", Mirror())
    inner = [painted(each, each.name, DIFFUSE) for each in worlds.room()]
    scene = worlds.scene(*inner, ahead)
    assert largest_z(image, scene, Reflectance("mirror"), *MATERIALS) < 4


def test_light_of_a_thick_bank_has_the_scores_of_many_scatterings():
    wall = painted(worlds.plane(9.0, 0.5), "wall", DIFFUSE)
    scene = worlds.scene(wall, volumes=worlds.bank(0.6, albedo=0.9, g=0.7))
    assert largest_z(image, scene, Reflectance("wall"), Albedo(0)) < 4


def test_light_that_a_mirror_throws_straight_back_is_proportional_to_its_reflectance():
    facing = painted(worlds.plane(3.0, 0.8, half_size_m=3.0), "mirror", Mirror())
    light, (derivative,) = image(worlds.scene(facing), scores_of(Reflectance("mirror")))
    np.testing.assert_allclose(derivative, light, rtol=1e-6)
    assert light.sum() > 0
