"""Lamps and media held against Mitsuba's `volpath`: scenes after its participating-media tests.

    python benchmarks/mitsuba_scenes.py [--quick] [--json] [--markdown]

Each scene is rendered by `spisim picture`'s code and by Mitsuba's own integrator, with the same
camera, pixels and optical properties. A pixel's means over independent pictures are compared by
Welch's test; the smallest p-value of a scene has to exceed that of Šidák's correction for all of
its pixels at a level of 1 %. Both trace the same triangles: Mitsuba's test scenes themselves have
interpolated normals, which nothing here has. The scenes are made in this file.
"""

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from mitsuba_reference import Renderer
from numpy.typing import NDArray
from options import benchmark_options, finish
from scipy import stats

from spisim.atmosphere import Atmosphere, HenyeyGreenstein, Isotropic, explicit
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Ambient, Material, Scene, SceneObject, Volume, look_at
from spisim.scene.bsdf import (
    Bsdf,
    Dielectric,
    Diffuse,
    Plastic,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinPane,
)
from spisim.scene.lamps import (
    AreaLamp,
    DirectionalLamp,
    EnvironmentLamp,
    Lamp,
    PointLamp,
    Strength,
)
from spisim.transport import camera_view
from spisim.transport.backend import activate
from spisim.transport.engine.ends import Projector
from spisim.transport.picture import camera_at
from spisim_paper.checks import Check, Table, surroundings

activate()
import drjit as dr  # noqa: E402 - the variant comes first
import mitsuba as mi  # noqa: E402

DOCS = Path(__file__).parents[1] / "docs" / "results" / "transport.md"
FOV_DEG = 38.0
LEVEL = 0.01
CLEAR = Atmosphere(0.0, 1.0, Isotropic(), "clear")
POSE = look_at((4.0, 0.0, 0.5), (0.0, 0.0, -0.4), (0.0, 0.0, 1.0))

Pictures = NDArray[np.float64]


@dataclass(frozen=True)
class SampleBudget:
    """Pixels a side, pictures, and paths per pixel in each."""

    side: int
    pictures: int
    ours: int
    theirs: int


FULL, QUICK = SampleBudget(64, 16, 128, 256), SampleBudget(16, 12, 64, 128)


@dataclass(frozen=True)
class Comparison:
    """Pictures (n, H, W) by both, and their processor times."""

    ours: Pictures
    theirs: Pictures
    seconds: tuple[float, float]

    @property
    def p_values(self) -> Pictures:
        """Of the pixels (H, W); 1 where neither picture has any light or noise."""
        with np.errstate(invalid="ignore", divide="ignore"):
            p = stats.ttest_ind(self.ours, self.theirs, axis=0, equal_var=False).pvalue
        same = np.isclose(self.ours.mean(axis=0), self.theirs.mean(axis=0), rtol=1e-5)
        return np.where(np.isnan(p), np.where(same, 1.0, 0.0), p)

    @property
    def margin(self) -> float:
        """Smallest p-value over that which Šidák's correction asks for."""
        p = self.p_values
        return float(p.min() / (1 - (1 - LEVEL) ** (1 / p.size)))

    @property
    def bias(self) -> tuple[float, float]:
        """Of the mean radiance relative to theirs, and its standard error."""
        ours, theirs = (pictures.mean(axis=(1, 2)) for pictures in (self.ours, self.theirs))
        error = np.hypot(stats.sem(ours), stats.sem(theirs)) / theirs.mean()
        return float(ours.mean() / theirs.mean() - 1), float(error)


def main() -> int:
    """The smallest p-value by scene."""
    options = benchmark_options(__doc__, "small and noisy pictures", DOCS)
    effort = QUICK if options.quick else FULL
    rows, checks = [], []
    for name, make in SCENES.items():
        result = compare(make(), effort)
        print(f"{name}: smallest p over Šidák's {result.margin:.3g}", file=sys.stderr, flush=True)
        bias, error = result.bias
        p = result.p_values
        seconds = " / ".join(f"{each:.1f}" for each in result.seconds)
        noise = " / ".join(
            f"{np.median(each.std(axis=0) / np.maximum(each.mean(axis=0), 1e-12)):.3f}"
            for each in (result.ours, result.theirs)
        )
        rows.append((name, f"{p.min():.1e}", f"{(p < 0.01).mean():.2%}",
                     f"{bias:+.3%} ± {error:.3%}", noise, seconds))  # fmt: skip
        checks.append(Check(f"smallest p over Šidák's, {name}", result.margin, 1.0, at_least=True))
    columns = (
        "scene",
        "smallest p",
        "p < 1 %",
        "mean over theirs",
        "noise of a picture",
        "time, s",
    )
    title = (
        f"Lamps and media against Mitsuba's volpath, {effort.side} × {effort.side} pixels, "
        f"{effort.pictures} pictures of {effort.ours} and {effort.theirs} paths per pixel; noise "
        "and times ours / theirs:"
    )
    around = surroundings(("spisim", "mitsuba", "drjit", "numpy", "scipy"))
    return finish(options, DOCS, "mitsuba-scenes", around, [Table(title, columns, rows)], checks)


def compare(scene: Scene, effort: SampleBudget) -> Comparison:
    """Pictures by both."""
    instrument = load_instrument("paper")
    pictures, seconds = [], []
    for render in (ours(scene, instrument, effort), theirs(scene, instrument, effort)):
        began = time.process_time()
        pictures.append(np.array([render(seed) for seed in range(effort.pictures)]))
        seconds.append(time.process_time() - began)
    return Comparison(pictures[0], pictures[1], (seconds[0], seconds[1]))


def ours(scene: Scene, instrument: Instrument, effort: SampleBudget) -> Callable[[int], Pictures]:
    """As `spisim picture` makes it, with the projector off."""
    dark = np.zeros(instrument.projector.shape)

    def render(seed: int) -> Pictures:
        view = camera_view(
            scene, instrument, width=effort.side, height=effort.side, fov_deg=FOV_DEG,
            pattern=dark, position_m=(0.0, 0.0, 0.0), spp=effort.ours, seed=seed,
        )  # fmt: skip
        return view.astype(np.float64)

    return render


def theirs(scene: Scene, instrument: Instrument, effort: SampleBudget) -> Callable[[int], Pictures]:
    """By Mitsuba's path tracer along the rays of the same camera."""
    projector = InstrumentView.placed(scene, instrument).projector
    camera = camera_at(scene, projector, effort.side, effort.side, FOV_DEG, (0.0, 0.0, 0.0))
    renderer = Renderer(scene, watts_per_klm=instrument.daylight_irradiance(1.0))
    lanes = effort.theirs * camera.pixels

    def render(seed: int) -> Pictures:
        sampler: Any = mi.load_dict({"type": "independent"})
        sampler.seed(dr.opaque(mi.UInt32, 1000 + seed), lanes)
        ray, _ = Projector.of(camera, effort.theirs).pencil(dr.arange(mi.UInt32, lanes), sampler)
        radiance = renderer.radiance(ray.o, ray.d, sampler).numpy()
        shape = effort.theirs, effort.side, effort.side
        return np.asarray(radiance, float).reshape(shape).mean(axis=0)

    return render


def scene_of(
    *things: SceneObject, volumes: tuple[Volume, ...] = (), lamps: tuple[Lamp, ...] = ()
) -> Scene:
    """Things before the camera, in clear air."""
    return Scene("scene", things, CLEAR, Ambient(), POSE, volumes=volumes, lamps=lamps)


def thing(
    name: str, mesh: trimesh.Trimesh, bsdf: Bsdf | None = None, reflectance: float = 0.5
) -> SceneObject:
    """An object."""
    return SceneObject(name, mesh, Material(name, reflectance, "made up", bsdf or Diffuse()))


def ball(radius_m: float = 0.75, subdivisions: int = 3) -> trimesh.Trimesh:
    """About the origin."""
    return trimesh.creation.icosphere(subdivisions, radius_m)


def cup() -> trimesh.Trimesh:
    """Below the ball: a closed vessel with a hollow, not convex."""
    profile = [(0, -1.0), (0.6, -1.0), (0.9, -0.85), (0.9, -0.6), (0.8, -0.6), (0.6, -0.8),
               (0, -0.9)]  # fmt: skip
    return trimesh.creation.revolve(np.array(profile), sections=48)


def ring(major_m: float, minor_m: float, tilt_rad: float = 0.6) -> trimesh.Trimesh:
    """Within the ball."""
    turn = trimesh.transformations.rotation_matrix(tilt_rad, [1, 0.3, 0])
    return trimesh.creation.torus(
        major_m, minor_m, major_sections=40, minor_sections=20
    ).apply_transform(turn)


def backdrop() -> SceneObject:
    """Floor and a wall behind."""
    floor, wall = trimesh.creation.box((8, 8, 0.1)), trimesh.creation.box((0.1, 8, 6))
    floor.apply_translation((0, 0, -1.1))
    wall.apply_translation((-3, 0, 1.9))
    return thing("backdrop", trimesh.util.concatenate([floor, wall]), reflectance=0.3)


def sky(strength: float = 1.0) -> EnvironmentLamp:
    """A made-up picture of a hall: bright windows on one side, dim elsewhere."""
    rows, columns = np.mgrid[0.5:32.5, 0.5:64.5]
    height, azimuth = np.pi / 2 - rows / 32 * np.pi, columns / 64 * 2 * np.pi
    picture = 0.2 + 0.15 * np.sin(height) + 0.1 * np.cos(3 * azimuth)
    picture += 6.0 * (np.abs(height - 0.5) < 0.3) * (np.abs(azimuth - 1.2) < 0.5)
    turn = trimesh.transformations.rotation_matrix(0.4, [0, 0.2, 1])[:3, :3]
    return EnvironmentLamp("hall", watts(strength), picture.astype(np.float32), turn)


def watts(amount: float) -> Strength:
    """In the band."""
    return Strength(amount, luminous=False)


def panel(strength: float, centre: tuple[float, float, float] = (1.3, 0.9, 0.3)) -> Any:
    """A shining cube beside the ball, black itself, and its lamp."""
    mesh = trimesh.creation.box((0.5, 0.5, 0.5))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
    mesh.apply_translation(centre)
    shining = thing("cube", mesh, reflectance=0.0)
    return shining, AreaLamp("cube", "cube", watts(strength), float(mesh.area))


def within(
    name: str, mesh: trimesh.Trimesh | SceneObject, extinction: float, albedo: float, g: float = 0.0
) -> Volume:
    """A medium within a mesh that light does not notice, or within an object."""
    carrier = mesh if isinstance(mesh, SceneObject) else None
    shape = mesh.mesh if isinstance(mesh, SceneObject) else mesh
    low, high = shape.bounds
    pose = np.diag([*(high - low), 1.0])
    pose[:3, 3] = low
    phase = HenyeyGreenstein(g) if g else Isotropic()
    return Volume(name, explicit(extinction, albedo, phase), pose, shape=shape, carrier=carrier)


def bands() -> NDArray[np.float32]:
    """Relative densities on a grid of 16³: stripes with sharp edges, and a dense corner."""
    z, y, x = np.mgrid[:16, :16, :16] / 16
    density = np.maximum(0, np.sin(16 * (x + 4 * ((y - 0.5) ** 2 - 0.25)) + 1) * 0.4)
    density[(x > 0.2) & (y > 0.7) & (z < 0.5)] = 1.0
    return density.astype(np.float32)


def null_media() -> Scene:
    """Two bodies of fog, one not convex, under an environment."""
    return scene_of(
        backdrop(),
        volumes=(within("ball", ball(), 3.0, 0.99), within("cup", cup(), 3.0, 0.99, 0.5)),
        lamps=(sky(),),
    )


def grid_medium() -> Scene:
    """A grid in a box and a diffuse cup, under an environment."""
    pose = np.diag([1.5, 1.5, 1.5, 1.0])
    pose[:3, 3] = -0.75
    fog = Volume("bands", explicit(8.0, 0.9, Isotropic()), pose, bands())
    return scene_of(
        backdrop(), thing("cup", cup().apply_translation((0, 0, -0.1))),
        volumes=(fog,), lamps=(sky(),)
    )  # fmt: skip


def grid_in_a_mesh() -> Scene:
    """The same grid within the ball's mesh, lit by a lamp from afar and a constant environment."""
    fog = replace(within("ball", ball(), 6.0, 0.8, 0.3), density=bands())
    lamps = (
        DirectionalLamp("sun", (-0.6, -0.48, -0.64), watts(2.0)),
        EnvironmentLamp("even", watts(0.3), None, np.eye(3)),
    )
    return scene_of(backdrop(), volumes=(fog,), lamps=lamps)


def area_lamp() -> Scene:
    """Fog behind thin glass, fog bounded by nothing, and a shining cube."""
    vessel = thing("vessel", cup(), ThinPane(1.33), 0.0)
    shining, lamp = panel(18.0)
    return scene_of(
        backdrop(), vessel, shining,
        volumes=(within("ball", ball(), 2.5, 0.99), within("milk", vessel, 2.5, 0.99)),
        lamps=(lamp,),
    )  # fmt: skip


def objects_inside() -> Scene:
    """Rings of rough plastic and chalk within fog behind thin glass, under an environment."""
    vessel = thing("vessel", ball(0.9), ThinPane(1.33), 0.0)
    return scene_of(
        backdrop(), vessel, thing("plastic", ring(0.5, 0.15), RoughPlastic(0.1, 1.49), 0.9),
        thing("chalk", ring(0.2, 0.08, 1.5), reflectance=0.95),
        volumes=(within("milk", vessel, 2.0, 0.99),), lamps=(sky(),),
    )  # fmt: skip


def lamp_inside() -> Scene:
    """A shining ring within dense fog behind thin glass, and a dim environment."""
    vessel = thing("vessel", ball(0.9), ThinPane(1.33), 0.0)
    shining = thing("ring", ring(0.5, 0.12), reflectance=0.0)
    lamp = AreaLamp("ring", "ring", watts(1.0), float(shining.mesh.area))
    return scene_of(
        backdrop(), vessel, shining,
        volumes=(within("milk", vessel, 5.0, 0.99),), lamps=(lamp, sky(0.4)),
    )  # fmt: skip


def glass() -> Scene:
    """Thin milk within smooth glass, under an environment; nothing else."""
    vessel = thing("vessel", ball(0.9, 2), Dielectric(1.33), 0.0)
    return scene_of(vessel, volumes=(within("milk", vessel, 0.5, 0.99),), lamps=(sky(),))


def rough_glass_spot() -> Scene:
    """Milk within rough glass, in the light of a spot lamp behind it."""
    vessel = thing("vessel", ball(0.8), RoughDielectric(0.3, 1.3), 0.0)
    spot = PointLamp("spot", (-2.0, 0.0, -0.5), watts(1.0), tuple(np.array([2, 0, 1]) / 5**0.5),
                     np.radians(60), np.radians(45))  # fmt: skip
    return scene_of(backdrop(), vessel, volumes=(within("milk", vessel, 1.0, 0.5),), lamps=(spot,))


def point_lamps() -> Scene:
    """Two point lamps outside of fog in a ball, and a body of rough metal."""
    lamps = (
        PointLamp("left", (1.0, -1.5, 1.0), watts(3.0)),
        PointLamp("right", (0.5, 1.6, 0.2), watts(2.0)),
    )
    pose = np.diag([1.5, 1.5, 1.5, 1.0])
    pose[:3, 3] = -0.75
    fog = Volume("ball", explicit(2.0, 0.9, HenyeyGreenstein(0.7)), pose, shape="ball")
    metal = thing("metal", cup().apply_translation((0, 0, -0.1)), RoughConductor(0.2, 1.4, 7.0))
    return scene_of(backdrop(), metal, volumes=(fog,), lamps=lamps)


def surfaces() -> Scene:
    """No medium: plastic and rough plastic, a shining cube and an environment."""
    shining, lamp = panel(10.0)
    return scene_of(
        backdrop(), shining, thing("smooth", ball(), Plastic(1.49), 0.4),
        thing("rough", cup().apply_translation((0, 0, -0.1)), RoughPlastic(0.1, 1.49), 0.6),
        lamps=(lamp, sky()),
    )  # fmt: skip


SCENES: Mapping[str, Callable[[], Scene]] = {
    "fog in meshes, environment": null_media,
    "grid in a box, environment": grid_medium,
    "grid in a mesh, directional, constant": grid_in_a_mesh,
    "fog and thin glass, area lamp": area_lamp,
    "objects in fog in thin glass": objects_inside,
    "lamp in fog in thin glass": lamp_inside,
    "milk in glass, environment": glass,
    "milk in rough glass, spot": rough_glass_spot,
    "fog in a ball, point lamps": point_lamps,
    "no medium, area lamp, environment": surfaces,
}

if __name__ == "__main__":
    sys.exit(main())
