"""Zones of a ranging sensor: traced histograms against direct integrals, ranges, and the surrogate.

Walls, tilted or with an edge, are scattered from once: a sum over the fields of the zones, which
knows nothing of the transport, gives what every bin should hold.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.stats import norm, t

from reconstruction.base.arrays import Floats
from reconstruction.capture import Spots
from reconstruction.ranging import measure_ranges
from spisim.atmosphere import CLEAR
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Ambient, Material, Scene, SceneObject
from spisim.simulation.light import LightSequence, solve
from spisim.simulation.light.path_bins import spot_bins
from spisim.simulation.light.spots import ranging_histogram
from spisim.simulation.light.surrogate import surrogate
from spisim.simulation.measurement.spots import spot_light
from spisim.transport.backend import with_backend
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.world import build_world
from spisim_paper.checks import Check, Table

PRESETS = "vl53l5cx", "tmf8820"
TITLE = (
    "Zones that look at walls, against direct integrals: largest z of a bin, all light, error of "
    "the centre zone in a long exposure; light and mean path of the surrogate less those traced."
)
#: Points across and down a zone in the integral (edges of walls are upright), and paths and
#: launches of the traced histograms.
ACROSS, DOWN, PATHS, LAUNCHES = 1024, 512, 2**12, 64
#: Distance by which a point may lie behind itself.
TINY_M = 1e-9
#: Bins matter that hold more than this fraction of the fullest of their zone.
MATTERS = 0.01
#: Frames in a long exposure, whose noise lies below a promise in centimetres.
LONGER = 16
#: Of the bin farthest off, as of a single number.
MAX_Z = 4.0


@dataclass(frozen=True)
class Wall:
    """A Lambertian plane at a distance, turned about y, from `left` to `right` of its middle."""

    distance_m: float
    tilt_rad: float = 0.0
    reflectance: float = 0.5
    left_m: float = -60.0
    right_m: float = 60.0

    @property
    def turn(self) -> Floats:
        """Columns: along the wall, down, and the normal away from the instrument."""
        matrix = trimesh.transformations.rotation_matrix(self.tilt_rad, [0, 1, 0])
        return np.asarray(matrix[:3, :3], dtype=np.float64)

    def thing(self, name: str) -> SceneObject:
        """The wall as an object of a scene whose world is the optical frame."""
        corners = [(x, y, 0) for y in (-60.0, 60.0) for x in (self.left_m, self.right_m)]
        mesh = trimesh.Trimesh(
            corners @ self.turn.T + (0, 0, self.distance_m), [[0, 1, 3], [0, 3, 2]]
        )
        return SceneObject(name, mesh, Material(name, self.reflectance, "benchmark"))

    def along(self, origin: Floats, rays: Floats) -> Floats:
        """Distances (...) along rays (..., 3); infinite where they miss it."""
        normal, middle = self.turn[:, 2], np.array([0, 0, self.distance_m])
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (middle - origin) @ normal / (rays @ normal)
            across = (origin + along[..., None] * rays - middle) @ self.turn[:, 0]
        there = (along > 0) & (across >= self.left_m) & (across <= self.right_m)
        return np.where(there, along, np.inf)


#: Within the 1.7 m of `tmf8820`.
SCENES = {
    "wall": [Wall(1.4)],
    "tilted": [Wall(1.5, 0.7)],
    "edge": [Wall(1.6, reflectance=0.8), Wall(1.2, right_m=0.1, reflectance=0.2)],
}


def scene(walls: list[Wall], wavelength_nm: float = 940.0) -> Scene:
    """Walls in the dark, seen from the origin along z."""
    things = tuple(wall.thing(f"wall {number}") for number, wall in enumerate(walls))
    return Scene("walls", things, CLEAR, Ambient(), np.eye(4), wavelength_nm=wavelength_nm)


def integrated(instrument: Instrument, walls: list[Wall], path_m: Floats) -> Floats:
    """Light (zones, bins) that walls scatter once, per emitted watt, by a sum over directions."""
    zones, detector = instrument.zones, instrument.tof.detector
    rows, columns = zones.shape
    half_width, half_height = zones.tan_half
    x = (2 * (np.arange(columns * ACROSS) + 0.5) / (columns * ACROSS) - 1) * half_width
    y = (2 * (np.arange(DOWN) + 0.5) / DOWN - 1) * half_height / rows
    receiver, histogram = np.array(detector.positions_m[0]), np.zeros((rows * columns, path_m.size))
    for row in range(rows):
        middle = (2 * (row + 0.5) / rows - 1) * half_height
        plane = np.stack([*np.meshgrid(x, y + middle), np.ones((DOWN, x.size))], axis=-1)
        cosine = 1 / np.linalg.norm(plane, axis=-1)
        rays = plane * cosine[..., None]
        all_along = np.stack([wall.along(receiver, rays) for wall in walls])
        nearest, along = all_along.argmin(axis=0), all_along.min(axis=0)
        met = np.isfinite(along)
        points = receiver + np.where(met, along, 1.0)[..., None] * rays
        out = np.linalg.norm(points, axis=-1)
        normals = np.stack([wall.turn[:, 2] for wall in walls])[nearest]
        reflectance = np.array([wall.reflectance for wall in walls])[nearest]
        leaving = points[..., 2] / out
        first = np.min([wall.along(np.zeros(3), points / out[..., None]) for wall in walls], axis=0)
        lit = (leaving >= np.cos(np.radians(zones.flood_deg) / 2)) & met & (first > out - TINY_M)
        intensity = zones.axial_intensity * leaving**zones.flood_falloff * lit
        arriving = np.abs(np.sum(points * normals, axis=-1)) / out
        radiance = reflectance / np.pi * intensity * arriving / out**2
        etendue = detector.aperture_area_m2 * cosine ** (4 + detector.vignetting)
        power = radiance * etendue * zones.solid_angle / (ACROSS * DOWN)
        number = row * columns + np.arange(x.size) // ACROSS
        position = (out + np.where(met, along, 1.0)) / path_m[1]
        low = position.astype(int)
        cell = np.broadcast_to(number, low.shape) * path_m.size + low
        for offset, fraction in ((0, 1 - position + low), (1, position - low)):
            histogram += np.bincount(
                (cell + offset).ravel(), (power * fraction).ravel(), histogram.size
            ).reshape(histogram.shape)
    return histogram


@with_backend
def against_integral(instrument: Instrument, walls: list[Wall], seed: int) -> tuple[float, float]:
    """Largest |z| of the bins that matter, and error of all light, by once scattered light.

    The z is that of a single number as improbable as the largest of so many bins, whose errors are
    those of `LAUNCHES` samples: of a thousand bins one is 4 off, by chance, every eighth time.
    """
    placed = InstrumentView.of(instrument, np.eye(4))
    world = build_world(scene(walls))
    # As wide as of spots: finer ones, as of fast zones, hold too few paths for an error.
    bins = spot_bins(
        world.axis_distances_m(placed.beams), instrument.ranging.tof.unambiguous_range_m
    )
    expected = integrated(instrument, walls, bins.centres_m)
    budget = PathBudget(PATHS, min_launches=LAUNCHES)
    estimate = ranging_histogram(
        world, placed, bins, budget, seed=np.random.SeedSequence(seed), max_vertices=1
    )
    mean, error = estimate.mean["histogram"], estimate.error["histogram"]
    matters = expected > MATTERS * expected.max(axis=1, keepdims=True)
    z = (mean - expected)[matters] / error[matters]
    one = 2 * t.sf(np.abs(z).max(), LAUNCHES - 1)
    any_bin = -np.expm1(z.size * np.log1p(-one))
    return float(norm.isf(any_bin / 2)), float(mean.sum() / expected.sum() - 1)


def centre_error_m(instrument: Instrument, walls: list[Wall], seed: int) -> float:
    """Largest error of the zones nearest to the axis, by `dtof` of a long exposure, m."""
    longer = instrument.tof.model_copy(update={"pulses": LONGER * instrument.tof.pulses})
    instrument = instrument.model_copy(update={"tof": longer})
    light = solve(scene(walls), instrument, spp=64, seed=seed)
    spots = recorded(instrument, LightSequence(np.zeros(1), (light,)), seed)
    directions = instrument.zones.directions
    middle = directions[:, 2] > directions[:, 2].max() - 1e-9
    receiver = np.array(instrument.tof.detector.positions_m[0])
    truth = np.min([wall.along(receiver, directions) for wall in walls], axis=0)
    return float(np.abs(measure_ranges(spots).range_m - truth)[middle].max())


def recorded(instrument: Instrument, light: LightSequence, seed: int) -> Spots:
    """One noisy frame."""
    rng = np.random.default_rng(seed)
    optics = instrument.spot_optics
    return instrument.ranging.tof.record(spot_light(instrument, light, 1), optics, rng)


def surrogate_error(instrument: Instrument, where: Scene, seed: int) -> tuple[float, float]:
    """Of the surrogate against traced light: of all zones' light, and of its mean path, m."""
    guessed, traced = surrogate(where, instrument, seed=seed), solve(where, instrument, seed=seed)
    sums = [light.spot_histogram.sum(axis=1) for light in (guessed, traced)]
    means = [
        light.spot_histogram @ light.path_length_m / light.spot_histogram.sum(axis=1)
        for light in (guessed, traced)
    ]
    ratio = np.sqrt(np.mean((sums[0] / sums[1] - 1) ** 2))
    return float(ratio), float(np.sqrt(np.mean((means[0] - means[1]) ** 2)))


def zones_benchmark(seed: int = 0) -> tuple[list[Table], list[Check]]:
    """All tables and promises about zones."""
    rows, checks = [], []
    for preset in PRESETS:
        instrument = load_instrument(preset)
        for name, walls in SCENES.items():
            z, total = against_integral(instrument, walls, seed)
            ratio, path_m = surrogate_error(instrument, scene(walls), seed)
            error_m = centre_error_m(instrument, walls, seed)
            rows.append((preset, name, f"{z:.1f}", f"{100 * total:+.2f} %", f"{100 * error_m:.2f}",
                         f"{100 * ratio:.1f} %", f"{100 * path_m:.2f}"))  # fmt: skip
            checks.append(Check(f"{preset}, {name}: largest z of a bin", z, MAX_Z))
            if name == "wall":
                checks.append(Check(f"{preset}: centre, m", error_m, 0.01))
    titles = ("preset", "scene", "largest z", "all light", "centre, cm", "surrogate", "path, cm")
    return [Table(TITLE, titles, rows)], checks
