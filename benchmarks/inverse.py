"""Derivatives of light by materials and media: right everywhere, and what they cost.

    python benchmarks/inverse.py [--quick] [--json] [--markdown]

Shipped scenes in clear air and in fog, with panes, mirrors and gloss, and with a plume on a grid of
densities. Derivatives along several parameters at once, 1, 2, 3, … times the logarithm of each, are
held against differences of passes with the same random numbers, by z over seeds: images, phasors,
spots' light over path length, daylight and the projector's light on the spots' detectors. Times are
of passes with and without ten scores, in turns, on one thread.
"""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from options import benchmark_options, finish

import spisim
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere import Atmosphere, henyey_greenstein
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene, Volume
from spisim.scene.bsdf import Conductor, Mirror
from spisim.simulation.light import Transport, solve
from spisim.simulation.light.sensitivity import sensitivities, weights_of
from spisim.simulation.light.solve import steady_light, streams_of
from spisim.transport import Outputs
from spisim.transport.backend import use_threads
from spisim.transport.engine.path_weights import Score, tracked_by
from spisim.transport.world import build_world
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "inverse.md"
INSTRUMENT = spisim.load_instrument("paper")
CLEAR = {"fog": None, "rain": None, "snow": None, "smoke": None}
FOGGY = CLEAR | {"fog": {"visibility_m": 50.0}}
ALBEDO = 0.95
"""Of the fog: water's is 1 within a thousandth, and leaves no room for a step up."""
PLUME = Atmosphere(0.15, 0.9, henyey_greenstein(0.7), "plume")
FREQUENCY_HZ = 15e6
SPP, SEEDS, COSTS = 64, 8, 5
STEP = 0.02
"""Of the logarithm of the last parameter."""
SAME = 3e-4
"""Relative difference that such steps in single precision may make."""
MAX_Z, MAX_COST = 4.0, 1.5
FIELDS = ("image", "phasors", "spot_histogram", "daylight_w", "spot_daylight_w", "spot_crosstalk_w")


@dataclass(frozen=True)
class Case:
    """A scene and the parameters along which light changes."""

    name: str
    scene: Scene
    parameters: tuple[str, ...]


def cases() -> list[Case]:
    """What is compared; the first alone by --quick."""
    shelf = ("concrete", "gloss", "aluminium-polished", "paint-white")
    room = ("concrete", "cardboard", "paint-white", "steel-painted")
    street = ("asphalt", "concrete", "brick")
    fog = ("scene.fog.extinction_per_m", "scene.fog.albedo")
    plume = tuple(f"scene.volumes.plume.{each}" for each in ("extinction_per_m", "albedo", "g"))
    return [
        Case("warehouse", scene("warehouse"), of(room)),
        Case("shelf: gloss, mirror, pane", scene("reflective-shelf"), of(shelf)),
        Case("the same, fog", scene("reflective-shelf", FOGGY), (*of(shelf), *fog)),
        Case("warehouse, fog", scene("warehouse", FOGGY), (*of(room), *fog)),
        Case("street: panes, fog", scene("street-canyon", FOGGY), (*of(street), *fog)),
        Case("warehouse, plume", with_plume(scene("warehouse")), (*plume, *of(room[:2]))),
        Case("the same, fog", with_plume(scene("warehouse", FOGGY)), (*plume, *fog)),
    ]


def of(materials: Sequence[str]) -> tuple[str, ...]:
    """Names of their reflectances."""
    return tuple(f"materials.{each}" for each in materials)


def scene(name: str, weather: dict[str, Any] = CLEAR) -> Scene:
    """A shipped scene, its smooth metal a mirror of a stated reflectance."""
    loaded = spisim.load_scene(name, changes=weather)
    things = []
    for thing in loaded.objects:
        material = thing.material
        if isinstance(material.bsdf, Conductor):
            material = replace(material, bsdf=Mirror())
        things.append(replace(thing, material=material))
    air = replace(loaded.atmosphere, albedo=ALBEDO if weather["fog"] else 1.0)
    return replace(loaded, objects=tuple(things), atmosphere=air)


def with_plume(loaded: Scene) -> Scene:
    """A cube of 3 m ahead, three times as dense at its far side as at its near one."""
    pose = np.eye(4)
    pose[:3, :3] = 3.0 * loaded.drone_pose[:3, :3]
    pose[:3, 3] = (loaded.drone_pose @ [-1.5, -1.5, 1.0, 1.0])[:3]
    density = np.linspace(0.5, 1.5, 6, dtype=np.float32)[:, None, None] * np.ones((1, 2, 2))
    return replace(loaded, volumes=(Volume("plume", PLUME, pose, np.float32(density)),))


def changed(loaded: Scene, steps: dict[str, float]) -> Scene:
    """The scene with the logarithm of each parameter moved, of `g` the parameter itself."""
    for name, step in steps.items():
        section, _, field = name.rpartition(".")
        if section == "materials":
            loaded = replace(
                loaded,
                objects=tuple(
                    replace(
                        thing,
                        material=replace(
                            thing.material, reflectance=thing.material.reflectance * np.exp(step)
                        ),
                    )
                    if thing.material.name == field
                    else thing
                    for thing in loaded.objects
                ),
            )
        elif section == "scene.fog":
            loaded = replace(loaded, atmosphere=moved(loaded.atmosphere, field, step))
        else:
            (volume,) = loaded.volumes
            medium = moved(volume.medium, field, step)
            loaded = replace(loaded, volumes=(replace(volume, medium=medium),))
    return loaded


def moved(medium: Atmosphere, field: str, step: float) -> Atmosphere:
    """A medium with one of its fields moved."""
    if field == "g":
        return replace(medium, phase=henyey_greenstein(medium.g + step))
    return replace(medium, **{field: getattr(medium, field) * np.exp(step)})


def traced(loaded: Scene, seed: int, weights: Sequence[Score] = ()) -> Transport:
    """One pass; its steady light from a fixed number of paths, the same in scenes alike."""
    outputs = Outputs(frequencies_hz=(FREQUENCY_HZ,), weights=tuple(weights))
    light = solve(loaded, INSTRUMENT, spp=SPP, seed=seed, outputs=outputs)
    steady = steady_light(
        loaded,
        INSTRUMENT,
        build_world(loaded, tracked_by(weights)),
        InstrumentView.placed(loaded, INSTRUMENT),
        streams_of(seed)[2:],
        target=1e9,
        path_weights=weights,
    )
    extra = {**light.extra, **steady.pop("extra")}
    return replace(light, **steady, extra=extra)


def figures(read: Callable[[str], Any], path_length_m: Floats) -> Floats:
    """Image by quarters, its phasor, spots near and far, and steady light; (figures,)."""
    image, phasor, spots, *steady = (np.asarray(read(field)) for field in FIELDS)
    height, width = (side // 2 for side in image.shape)
    quarters = [
        image[rows, columns].sum()
        for rows in (slice(height), slice(height, None))
        for columns in (slice(width), slice(width, None))
    ]
    near = path_length_m < 6.0
    total = phasor.sum()
    lasers = [spots[:, near].sum(), spots[:, ~near].sum()]
    return np.array([*quarters, total.real, total.imag, *lasers, *(each.sum() for each in steady)])


PARTS = {
    "image": slice(0, 4),
    "phasor": slice(4, 6),
    "spots": slice(6, 8),
    "daylight": slice(8, 10),
    "crosstalk": slice(10, 11),
}
"""Of the figures."""


def compare(case: Case) -> dict[str, tuple[float, float]]:
    """Largest |z| and the relative derivative of each part."""
    wanted = sensitivities(case.scene, case.parameters)
    weights, count = weights_of(wanted), len(wanted)
    along = {each.parameter: (k + 1) / count for k, each in enumerate(wanted)}
    lights, derivatives, differences = [], [], []
    for seed in range(SEEDS):
        light = traced(case.scene, seed, weights)  # type: ignore[arg-type]
        lights.append(figures(lambda field, light=light: values(light, field), light.path_length_m))

        def derivative(field: str, light: Transport = light) -> Any:
            return sum(
                along[each.parameter] / each.scale * each.of(light, field)[0] for each in wanted
            )

        derivatives.append(figures(derivative, light.path_length_m))
        ends = [
            traced(changed(case.scene, {n: sign * STEP * a for n, a in along.items()}), seed)
            for sign in (1, -1)
        ]
        high, low = (
            figures(lambda field, end=end: values(end, field), end.path_length_m) for end in ends
        )
        differences.append((high - low) / (2 * STEP))
    derived, total = np.array(derivatives), np.array(lights).mean(axis=0)
    off = derived - np.array(differences)
    error = np.hypot(off.std(axis=0, ddof=1) / np.sqrt(SEEDS), SAME * np.abs(total))
    z = np.divide(off.mean(axis=0), error, out=np.zeros(len(error)), where=error > 0)
    size = np.divide(derived.mean(axis=0), total, out=np.zeros(len(total)), where=total != 0)
    return {
        name: (float(np.abs(z[part]).max()), float(size[part].mean()))
        for name, part in PARTS.items()
    }


def values(light: Transport, field: str) -> Any:
    """A field of the light itself."""
    return light.extra["phasors"] if field == "phasors" else getattr(light, field)


def cost(case: Case) -> float:
    """Median time of a pass with ten scores over that of one without."""
    materials = sorted({each.material.name for each in case.scene.objects})
    names = [*case.parameters, *of(materials)]
    weights: dict[str, Score] = {}
    for name in names:
        try:
            weights |= {each.name: each for each in weights_of(sensitivities(case.scene, [name]))}  # type: ignore[misc]
        except InputError:
            continue
    ten = list(weights.values())[:10]
    assert len(ten) == 10
    seconds: list[list[float]] = [[], []]
    for turn in range(COSTS + 1):
        for which, some in enumerate(((), ten)):
            begun_s = time.process_time()
            solve(case.scene, INSTRUMENT, spp=SPP, seed=turn, outputs=Outputs(weights=tuple(some)))
            seconds[which].append(time.process_time() - begun_s)
    plain, weighted = (np.median(each[1:]) for each in seconds)
    return float(weighted / plain)


def main() -> int:
    """Compare and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "the first scene alone", PAGE)
    use_threads(1)
    chosen = cases()[:1] if options.quick else cases()
    results = [(case, compare(case), cost(case)) for case in chosen]
    rows = [
        (case.name, *(f"{z:.2f} ({size:+.2f})" for z, size in found.values()), f"{ratio:.2f}")
        for case, found, ratio in results
    ]
    tables = [
        Table(
            f"Largest |z| over {SEEDS} seeds of {SPP} paths a pixel and end, the mean relative "
            "derivative in brackets, and time with ten scores over none.",
            ("scene", *PARTS, "time"),
            rows,
        )
    ]
    largest = max(z for _, found, _ in results for z, _ in found.values())
    checks = [Check("largest |z| of derivatives", largest, MAX_Z)]
    checks.append(
        Check("time with ten scores over none", max(ratio for *_, ratio in results), MAX_COST)
    )
    around = surroundings(("spisim", "mitsuba"))
    return finish(options, PAGE, "inverse", around, tables, checks)


if __name__ == "__main__":
    sys.exit(main())
