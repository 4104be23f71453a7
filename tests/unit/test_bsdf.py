"""Mitsuba's surfaces neither make light nor lose track of it, alike from both sides.

Checked one surface point at a time: a white furnace, sampling against quadrature, and where a
picture lies on a mesh.
"""

import numpy as np
import pytest
import trimesh

from spisim.scene import Material, SceneObject, find_material
from spisim.scene.bsdf import (
    DISTRIBUTIONS,
    Bsdf,
    Clear,
    Conductor,
    Dielectric,
    Diffuse,
    Mirror,
    Plastic,
    Principled,
    Retroreflector,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinPane,
    fresnel_reflectance,
)
from spisim.scene.layout import straight_back
from spisim.transport.backend import activate
from spisim.transport.bsdf import bsdf_dict, is_null_transmitting
from spisim.transport.meshes import shapes

activate()
import drjit as dr  # noqa: E402 - the variant comes first
import mitsuba as mi  # noqa: E402

SAMPLES = 100_000
ANGLES = (1.0, 0.8, 0.3, 0.05)  # cosines of incidence
METAL = {"eta": 1.44, "k": 16.0}

ROUGH = [
    Diffuse(),
    RoughPlastic(0.2),
    RoughPlastic(0.5, 3.0),
    RoughPlastic(1.0, 1.33),
    RoughConductor(0.2, **METAL),
    RoughConductor(1.0, **METAL),
    RoughPlastic(0.2, distribution="beckmann"),
    RoughConductor(0.2, **METAL, distribution="beckmann"),
    RoughDielectric(0.3, distribution="beckmann"),
    RoughDielectric(0.3),
    RoughDielectric(1.0, 1.33),
    Principled(),
    Principled(0.3, metallic=0.4, specular=1.0),
    Principled(0.5, metallic=1.0),
    Retroreflector(0.4, 0.3),
    Retroreflector(0.4, 0.1),
]
SMOOTH = [
    Plastic(1.05),
    Plastic(),
    Plastic(3.0),
    RoughPlastic(0.01),
    RoughPlastic(0.01, 3.0),
    Mirror(),
    Conductor(**METAL),
    RoughConductor(0.01, **METAL),
    Dielectric(),
    Dielectric(3.48),
    RoughDielectric(0.01),
    ThinPane(),
    Principled(0.01, metallic=0.5, specular=1.0),
    Retroreflector(0.4, 0.001),
]


def material(bsdf: Bsdf, reflectance: float = 1.0, **pictures) -> Material:
    return Material("m", reflectance, "test", bsdf, **pictures)


def load(bsdf: Bsdf, reflectance: float = 1.0, **pictures):
    return mi.load_dict(bsdf_dict(material(bsdf, reflectance, **pictures)))


def load_single(bsdf: Bsdf, reflectance: float = 1.0):
    """Light of single facets alone."""

    def single(described):
        if not isinstance(described, dict):
            return described
        described = described.get("nested", described)
        return {key: single(value) for key, value in described.items()}

    return mi.load_dict(single(bsdf_dict(material(bsdf, reflectance))))


def context():
    """Light that travels from the projector: refraction then scales no radiance."""
    return mi.BSDFContext(mi.TransportMode.Importance)


def arriving(cosine: float, count: int):
    """Surface points lit along one direction, from below for a negative cosine."""
    si = mi.SurfaceInteraction3f()
    sine = np.full(count, np.sqrt(1 - cosine**2), np.float32)
    si.wi = mi.Vector3f(np.array([sine, 0 * sine, np.full_like(sine, cosine)]))
    return si


def sample(plugin, cosine: float, seed: int = 0):
    """Weights (samples,), directions (3, samples), their densities, and the points."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, SAMPLES)
    si = arriving(cosine, SAMPLES)
    drawn, weight = plugin.sample(context(), si, sampler.next_1d(), sampler.next_2d())
    density = drawn.pdf.numpy() * np.ones(SAMPLES)
    return np.where(density > 0, weight.x.numpy(), 0.0), drawn.wo, density, si


def integrate(plugin, cosine: float) -> tuple[np.ndarray, np.ndarray]:
    """∫ eval dω and ∫ pdf dω over the hemispheres below and above, by quadrature."""
    rows = 400
    theta, phi = np.meshgrid(
        (np.arange(rows) + 0.5) / rows * np.pi, (np.arange(2 * rows) + 0.5) / rows * np.pi
    )
    sine, cosines = np.sin(theta), np.cos(theta)
    directions = np.array([sine * np.cos(phi), sine * np.sin(phi), cosines]).reshape(3, -1)
    wo, si = mi.Vector3f(directions.astype(np.float32)), arriving(cosine, theta.size)
    area = (sine * (np.pi / rows) ** 2).ravel()
    above = cosines.ravel() > 0
    value = plugin.eval(context(), si, wo).x.numpy() * area
    density = plugin.pdf(context(), si, wo).numpy() * area
    return tuple(np.array([q[~above].sum(), q[above].sum()]) for q in (value, density))


def name(bsdf: Bsdf) -> str:
    return f"{type(bsdf).__name__}{list(vars(bsdf).values())}"


@pytest.mark.parametrize("bsdf", ROUGH + SMOOTH, ids=name)
def test_white_furnace(bsdf: Bsdf) -> None:
    plugin = load(bsdf, 1 - getattr(bsdf, "returned", 0))
    for cosine in [side * angle for angle in ANGLES for side in (1, -1)]:
        weights, *_ = sample(plugin, cosine)
        error = weights.std() / np.sqrt(SAMPLES)
        assert weights.mean() <= 1 + 4 * error + 1e-5, cosine  # 1e-5: single precision
        assert weights.mean() > 0.2, cosine


@pytest.mark.parametrize(
    "bsdf", [Diffuse(), Plastic(), Mirror(), ThinPane(), Dielectric()], ids=name
)
def test_lossless_surfaces_return_everything(bsdf: Bsdf) -> None:
    plugin = load(bsdf)
    for cosine in ANGLES:
        weights, *_ = sample(plugin, cosine)
        assert weights.mean() == pytest.approx(1, abs=4 * weights.std() / np.sqrt(SAMPLES) + 1e-4)


@pytest.mark.parametrize(
    ("bsdf", "reflectance"),
    [
        (RoughPlastic(0.1), 1.0),
        (RoughPlastic(0.4), 1.0),
        (RoughPlastic(1.0, 1.33), 1.0),
        (RoughPlastic(0.4, distribution="beckmann"), 1.0),
        (Principled(0.3), 1.0),
        (Principled(0.71, metallic=0.5), 1.0),
        (Principled(0.12, metallic=1.0), 1.0),
        (Principled(0.3, metallic=1.0), 1.0),
        (Principled(0.5, metallic=1.0), 1.0),
        (Principled(0.5, metallic=1.0), 0.5),
    ],
    ids=lambda each: name(each) if not isinstance(each, float) else str(each),
)
def test_facets_lose_no_light_to_each_other(bsdf: Bsdf, reflectance: float) -> None:
    """All light of a white surface, and of a metal as much as its reflectance."""
    plugin = load(bsdf, reflectance)
    for angle_deg in (0, 30, 60, 75, 85):
        weights, *_ = sample(plugin, float(np.cos(np.radians(angle_deg))))
        error = weights.std() / np.sqrt(SAMPLES)
        assert weights.mean() == pytest.approx(reflectance, abs=4 * error + 1e-3), angle_deg


@pytest.mark.parametrize("bsdf", [each for each in ROUGH if not isinstance(each, Clear)], ids=name)
def test_light_is_the_same_with_its_ends_swapped(bsdf: Bsdf) -> None:
    rng, plugin = np.random.default_rng(0), load(bsdf, 0.6)
    first, second = rng.normal(size=(2, 3, 1000)).astype(np.float32)
    first[2], second[2] = np.abs(first[2]), np.abs(second[2])
    first, second = (each / np.linalg.norm(each, axis=0) for each in (first, second))

    def scattered(incoming, outgoing) -> np.ndarray:
        si = mi.SurfaceInteraction3f()
        si.wi = mi.Vector3f(incoming)
        return plugin.eval(context(), si, mi.Vector3f(outgoing)).x.numpy() / outgoing[2]

    np.testing.assert_allclose(scattered(first, second), scattered(second, first), rtol=2e-3)


@pytest.mark.parametrize("bsdf", ROUGH, ids=name)
@pytest.mark.parametrize("cosine", [0.8, 0.3, -0.8])
def test_sampling_agrees_with_quadrature(bsdf: Bsdf, cosine: float) -> None:
    plugin = load(bsdf, reflectance=0.6)
    weights, wo, density, si = sample(plugin, cosine)
    value, expected = integrate(plugin, cosine)
    error = np.hypot(weights.std() / np.sqrt(SAMPLES), 3e-5)
    assert abs(weights.mean() - value.sum()) < 4 * error

    # What is drawn is as dense as it says: above all, in each hemisphere that light reaches.
    drawn = weights > 0
    reported = plugin.pdf(context(), si, wo).numpy()
    np.testing.assert_allclose(reported[drawn], density[drawn], rtol=1e-3, atol=1e-6)  # float32
    for above in (True, False):
        if value[int(above)] > 0:
            fraction = np.mean(drawn & ((wo.z.numpy() > 0) == above))
            spread = np.sqrt(fraction * (1 - fraction) / SAMPLES)
            assert abs(fraction - expected[int(above)]) < 4 * spread + 1e-3


@pytest.mark.parametrize("bsdf", ROUGH, ids=name)
def test_both_sides_alike_unless_light_gets_in(bsdf: Bsdf) -> None:
    plugin = load(bsdf, reflectance=0.6)
    upper, _ = integrate(plugin, 0.8)
    lower, _ = integrate(plugin, -0.8)
    if isinstance(bsdf, Clear):
        assert (upper > 0).all()
        assert (lower > 0).all()
    else:
        np.testing.assert_allclose(upper, lower[::-1], rtol=1e-6)
        assert upper[0] == 0


@pytest.mark.parametrize("bsdf", [Plastic(), RoughPlastic(0.2), RoughPlastic(0.05)], ids=name)
def test_body_under_a_coat_looks_as_bright_as_its_reflectance(bsdf: Bsdf) -> None:
    """Straight on, off the gloss: a paint of reflectance 0.6 is not darkened by its own coat."""
    si, towards = arriving(0.9, 1), mi.Vector3f(-0.6, 0.0, 0.8)
    si.wi = mi.Vector3f(-0.43589, 0.0, 0.9)
    body = mi.BSDFContext()
    body.component = 1
    value = load(bsdf, 0.6).eval(body, si, towards).x.numpy()[0]
    assert value * np.pi / 0.8 == pytest.approx(0.6, rel=0.03)


def test_metal_reflects_by_its_index_and_mirror_by_its_reflectance() -> None:
    metal = material(Conductor(**METAL), reflectance=0.1)
    weights, *_ = sample(mi.load_dict(bsdf_dict(metal)), 1.0)
    assert weights.mean() == pytest.approx(fresnel_reflectance(metal.bsdf), abs=1e-4)
    weights, *_ = sample(load(Mirror(), 0.7), 0.3)
    assert weights.mean() == pytest.approx(0.7, abs=1e-5)


@pytest.mark.parametrize(
    ("bsdf", "reflectance"),
    [
        (RoughConductor(0.2, **METAL), 1.0),
        (Principled(0.2, metallic=1.0), 1.0),
        (RoughPlastic(0.2), 0.0),  # its gloss alone
    ],
    ids=["conductor", "principled", "plastic"],
)
def test_roughness_is_the_width_of_the_facets_slopes(bsdf: Bsdf, reflectance: float) -> None:
    """GGX, seen straight on: half of all facets have a slope below α."""
    _, wo, _, si = sample(load_single(bsdf, reflectance), 1.0)
    facet = wo.numpy() + si.wi.numpy()
    slope = np.hypot(facet[0], facet[1]) / facet[2]
    assert np.mean(slope < 0.2) == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(SAMPLES))


def test_slopes_as_beckmann_has_them() -> None:
    """A Gaussian, seen straight on: of all facets 1 - 1/e have a slope below α."""
    for bsdf in (
        RoughConductor(0.2, **METAL, distribution="beckmann"),
        RoughPlastic(0.2, distribution="beckmann"),
    ):
        weights, wo, _, si = sample(load_single(bsdf, 0.0), 1.0)
        facet = wo.numpy() + si.wi.numpy()
        slope = np.hypot(facet[0], facet[1]) / facet[2]
        assert np.mean(slope[weights > 0] < 0.2) == pytest.approx(1 - np.exp(-1), abs=0.01)


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
@pytest.mark.parametrize("cosine", [1.0, 0.9, 0.5])
@pytest.mark.parametrize("roughness", [0.3, 0.6])
def test_straight_back_is_what_the_surface_sends(
    distribution: str, cosine: float, roughness: float
) -> None:
    """Mitsuba's shadowing of Beckmann's slopes is a fit, good to 0.4 %."""
    bsdf = RoughConductor(roughness, **METAL, distribution=distribution)
    si = arriving(cosine, 1)
    value = np.pi * load_single(bsdf).eval(context(), si, si.wi).x.numpy()[0]
    metal = material(bsdf, fresnel_reflectance(bsdf))
    assert straight_back(metal, cosine) == pytest.approx(value, rel=0.01)


@pytest.mark.parametrize("entrance_deg", [0.0, 40.0, 60.0])
@pytest.mark.parametrize("observation_deg", [0.0, 0.2, 0.5, 1.5])
def test_coefficient_of_retroreflection(entrance_deg: float, observation_deg: float) -> None:
    """R_A = f cos i cos o is the same in the plane of incidence, across it and between."""
    bsdf, beta, delta = Retroreflector(0.15), *np.radians([entrance_deg, observation_deg])
    si = arriving(np.cos(beta), 3)
    along, across = np.array([[np.cos(beta), 0, -np.sin(beta)], [0, 1, 0]])
    around = np.radians([[0.0], [45.0], [90.0]])
    aside = np.cos(around) * along + np.sin(around) * across
    wo = np.cos(delta) * si.wi.numpy().T + np.sin(delta) * aside
    value = load(bsdf, 0.0).eval(context(), si, mi.Vector3f(wo.T.astype(np.float32))).x.numpy()
    slope = delta / (2 * bsdf.roughness)
    closed = 0.15 * np.cos(beta) ** 5 / (4 * np.pi * bsdf.roughness**2 * (1 + slope**2) ** 2)
    tilted = (wo[:, 2] / np.cos(beta)) ** 2.5  # cos^k β of small δ is (cos i cos o)^(k/2)
    np.testing.assert_allclose(value * np.cos(beta), closed * tilted, rtol=2e-3)


def test_tape_is_what_the_norm_asks_for() -> None:
    """EN ISO 20471 (2013), class 2, at an entrance angle of 5°, to a quarter."""
    wi = np.array([np.sin(np.radians(5)), 0, np.cos(np.radians(5))])
    plugin = mi.load_dict(bsdf_dict(find_material("retroreflective-tape")))
    for observation_deg, minimum in ((0.2, 330), (1 / 3, 250), (1.0, 25), (1.5, 10)):
        turn = np.radians(5 + observation_deg)
        wo = mi.Vector3f(float(np.sin(turn)), 0.0, float(np.cos(turn)))
        value = plugin.eval(context(), arriving(wi[2], 1), wo).x.numpy()[0]
        assert value * wi[2] == pytest.approx(minimum, rel=0.25)


def test_mask_lets_the_rest_straight_through() -> None:
    plugin = load(Diffuse(), opacity=0.3)
    _, wo, _, si = sample(plugin, 0.8)
    straight = np.all(np.abs(wo.numpy() + si.wi.numpy()) < 1e-6, axis=0)
    assert straight.mean() == pytest.approx(0.7, abs=4 * np.sqrt(0.21 / SAMPLES))


def test_who_lets_light_through_unbent() -> None:
    passing = material(ThinPane()), material(Diffuse(), opacity=0.5)
    stopping = material(Diffuse()), material(Mirror()), material(Dielectric())
    assert all(map(is_null_transmitting, passing))
    assert not any(map(is_null_transmitting, stopping))


PICTURE = np.array([[0.1, 0.2], [0.3, 0.4]], np.float32)  # rows run down


def at_corners(made_of: Material, quantity) -> np.ndarray:
    """A quantity of (bsdf, interaction) near the corners of a unit square that carries a picture.

    The square lies in x and y with texture coordinates to match; the result has the picture's
    layout, y up.
    """
    mesh = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 1, 2], [0, 2, 3]],
        process=False,
        visual=trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]]),
    )
    world = mi.load_dict({"type": "scene", **shapes([SceneObject("square", mesh, made_of)])})
    x, y = (axis.ravel() for axis in np.meshgrid([0.25, 0.75], [0.75, 0.25]))
    origins = mi.Point3f(np.array([x, y, 0 * x + 1], dtype=np.float32))
    si = world.ray_intersect(mi.Ray3f(origins, mi.Vector3f(0, 0, -1)))
    return quantity(si.bsdf(), si).reshape(2, 2)


def test_texture_lies_on_the_mesh_the_right_way_up() -> None:
    def albedo(bsdf, si) -> np.ndarray:
        return bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1)).x.numpy() * np.pi

    result = at_corners(material(Diffuse(), 0.5, texture=PICTURE), albedo)
    np.testing.assert_allclose(result, 0.5 * PICTURE, rtol=1e-5)


def test_opacity_lies_on_the_mesh_the_right_way_up() -> None:
    def opacity(bsdf, si) -> np.ndarray:
        return 1 - bsdf.eval_null_transmission(si).x.numpy()

    result = at_corners(material(Diffuse(), opacity=PICTURE), opacity)
    np.testing.assert_allclose(result, PICTURE, rtol=1e-5)


@pytest.mark.parametrize(
    "bsdf",
    [
        Plastic(),
        RoughPlastic(0.2),
        Mirror(),
        RoughConductor(0.2, **METAL),
        Principled(),
        Retroreflector(0.2),
    ],
    ids=name,
)
def test_texture_dims_every_opaque_model(bsdf: Bsdf) -> None:
    def brightness(plugin, si) -> np.ndarray:
        weights = [
            plugin.sample(context(), si, dr.opaque(mi.Float, u), mi.Point2f(0.4, 0.6))[1].x.numpy()
            for u in np.linspace(0.02, 0.98, 25)
        ]
        return np.mean(weights, axis=0)

    bright = at_corners(material(bsdf, 0.8, texture=np.full((2, 2), 1, np.float32)), brightness)
    dimmed = at_corners(material(bsdf, 0.8, texture=PICTURE), brightness)
    assert (dimmed < 0.7 * bright).all()
    assert (np.diff(dimmed.ravel()) > 0).all()
