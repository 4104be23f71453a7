"""Drawn scenes of four boards in fog, one for each laser, and their light, traced once and kept."""

import hashlib
import sys
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from spisim.atmosphere import CLEAR, Atmosphere, GammaSizes, LogNormalSizes, Particles, fog
from spisim.atmosphere.structure import Structure
from spisim.instrument import Instrument, SpotLight
from spisim.instrument.views import InstrumentView
from spisim.scene import Ambient, Material, Scene, SceneObject
from spisim.scene.model import Volume
from spisim.simulation.light import NEAR_PATH_M
from spisim.transport.backend import with_backend
from spisim.transport.daylight import daylight_power, projector_power
from spisim.transport.engine.estimator import spot_histogram
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.world import build_world

CACHE = Path(__file__).parents[1] / "out" / "ranging"
VERSION = 2  # of what is kept: count it up where scenes or transport change
NATURAL = ("moderate-radiation", "heavy-radiation", "moderate-advection", "heavy-advection")
HAZES = ("haze-l", "haze-m", "haze-h", "chu-hogg")
SMOKES = ("biomass", "fog-machine", "hazer")
REFLECTANCES = (0.1, 0.8)
BOARD = 0.95  # width over the distance of its neighbour's middle, seen from the instrument
BINS = PathLengthBins.up_to(NEAR_PATH_M, 0.02)
# Optical frame (x right, y down, z forward) in a world whose z is up.
POSE = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.5], [0, 0, 0, 1]], dtype=np.float64)
#: A uniform sky lights upright boards half as much as the ground.
SKY_KLX = 2.0


@dataclass(frozen=True)
class Cell:
    """Conditions from which scenes are drawn: clear without a visibility.

    ``air`` may name a kind of fog, too; "natural" draws one of `NATURAL`.
    """

    name: str  # for people
    visibility_m: float | None
    nearest_m: float
    farthest_m: float
    air: str = "natural"
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Drawn:
    """One scene: ranges along the lasers and reflectances of the boards, (4,) each; its fog."""

    range_m: Floats
    reflectance: Floats
    medium: Atmosphere
    scene: Scene


@dataclass(frozen=True, eq=False)
class Light:
    """Of all scenes of a cell: fractions of a laser's power, and steady light in W on the spots.

    ``echo`` (scenes, 4, bins); ``daylight_w`` (scenes, 4) for 1 klx on a board in clear air;
    ``patterns_w`` (scenes, 4) of the projector.
    """

    echo: Floats
    daylight_w: Floats
    patterns_w: Floats

    def at(self, instrument: Instrument, daylight_klx: float) -> SpotLight:
        """What an instrument's detectors get of it."""
        detector = instrument.tof.detector

        def electrons(source: Literal["laser", "daylight", "projector"]) -> float:
            return instrument.electrons_per_joule(detector, source)

        steady = daylight_klx * self.daylight_w * electrons("daylight")
        steady = steady + self.patterns_w * electrons("projector") + detector.sensor.dark_rate_hz
        power_w = instrument.lasers.power_w
        return SpotLight(BINS.centres_m, self.echo * power_w * electrons("laser"), steady, power_w)


def draw(cell: Cell, number: int, directions: Floats) -> Drawn:
    """A scene of the cell, the same for the same number."""
    rng = np.random.default_rng([cell.seed, number])
    range_m = rng.uniform(cell.nearest_m, cell.farthest_m, 4)
    reflectance = rng.uniform(*REFLECTANCES, 4)
    medium = _medium(cell, rng)
    patchy = cell.air == "patchy"
    scene = Scene(
        name=f"{cell.name} {number}",
        objects=tuple(
            _board(spot, *each)
            for spot, each in enumerate(zip(directions, range_m, reflectance, strict=True))
        ),
        atmosphere=CLEAR if patchy else medium,
        ambient=Ambient(sky_klx=SKY_KLX),
        drone_pose=POSE,
        volumes=(_patches(medium, rng),) if patchy else (),
    )
    return Drawn(range_m, reflectance, medium, scene)


def _board(spot: int, direction: Floats, range_m: float, reflectance: float) -> SceneObject:
    """A square across the optical axis, behind no other, whose middle the laser meets."""
    x, y, z = range_m * direction
    half = BOARD * min(abs(x), abs(y))
    corners = [
        [x - half, y - half, z], [x + half, y - half, z],
        [x + half, y + half, z], [x - half, y + half, z],
    ]  # fmt: skip
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).apply_transform(POSE)
    name = f"board {spot}"
    return SceneObject(name, mesh, Material(name, float(reflectance), "drawn"))


def _medium(cell: Cell, rng: np.random.Generator) -> Atmosphere:
    if cell.visibility_m is None:
        return CLEAR
    kind: str | Particles = str(rng.choice(NATURAL))
    if cell.air in NATURAL:
        kind = cell.air
    if cell.air == "unseen":
        others: list[str | Particles] = [
            Particles(GammaSizes(rng.uniform(1, 8), 1, rng.uniform(1, 8))),
            Particles(LogNormalSizes(rng.uniform(0.4, 4), rng.uniform(1.3, 2))),
            str(rng.choice(HAZES)),
            str(rng.choice(SMOKES)),
        ]
        kind = others[rng.integers(len(others))]
    return fog(cell.visibility_m, kind)


def _patches(medium: Atmosphere, rng: np.random.Generator) -> Volume:
    """A box around instrument and boards that is filled unevenly."""
    to_world = np.diag([14.0, 6.0, 5.0, 1.0])
    to_world[:3, 3] = [-1.0, -3.0, -1.0]
    structure = Structure(
        contrast=rng.uniform(0.2, 0.8),
        correlation_length_m=rng.uniform(0.5, 3.0),
        seed=int(rng.integers(2**30)),
    )
    return Volume("patches", medium, to_world, structure.density(to_world), structure)


def light_of(cell: Cell, scenes: int, instrument: Instrument, paths: int) -> Light:
    """Light of the first scenes of a cell, traced unless it is kept from before."""
    reported = (VERSION, astuple(cell)[1:], scenes, paths, _optics(instrument))
    digest = hashlib.sha256(repr(reported).encode()).hexdigest()[:12]
    path = CACHE / f"{cell.air}-{digest}.npz"
    if not path.exists():
        print(f"tracing {scenes} scenes: {cell.name}", file=sys.stderr, flush=True)
        directions = instrument.lasers.directions
        traced = [
            _traced(draw(cell, number, directions).scene, instrument, [cell.seed, number], paths)
            for number in range(scenes)
        ]
        CACHE.mkdir(parents=True, exist_ok=True)
        names = ("echo", "daylight_w", "patterns_w")
        arrays = {n: np.array(v) for n, v in zip(names, zip(*traced, strict=True), strict=True)}
        np.savez_compressed(path, **arrays)
    with np.load(path) as retained:
        return Light(*(retained[name] for name in ("echo", "daylight_w", "patterns_w")))


def _optics(instrument: Instrument) -> str:
    """All that the light on the spots depends on."""
    detector, lasers = instrument.tof.detector, instrument.lasers
    return repr(
        (
            instrument.projector,
            instrument.filter,
            instrument.wavelength_nm,
            lasers.directions.tolist(),
            lasers.divergence_mrad,
            lasers.waist_mm,
            detector.positions_m,
            detector.field_of_view_deg,
            detector.vignetting,
            detector.aperture_area_m2,
        )
    )


@with_backend
def _traced(
    scene: Scene, instrument: Instrument, seed: list[int], paths: int
) -> tuple[Floats, Floats, Floats]:
    """Fields of `Light`, of one scene; all orders of scattering."""
    placed, world = InstrumentView.placed(scene, instrument), build_world(scene)
    streams = np.random.SeedSequence(seed, spawn_key=(1,)).spawn(3)
    echo = spot_histogram(
        world, placed.beams, placed.tof, BINS, PathBudget(paths, min_launches=1), seed=streams[0]
    ).mean["histogram"]
    daylight = daylight_power(scene, instrument, world, placed.tof, seed=streams[1])
    patterns = projector_power(
        world, placed.projector, instrument.mean_powers_w, placed.tof, seed=streams[2]
    )
    return echo, daylight.power_w, patterns.power_w
