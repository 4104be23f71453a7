"""Fits of offset, gain and dark level to measured histograms of a wall, pose by pose.

The instrument is the preset `tmf8820`, the wall a white board at the robot's distance. The delay of
the sensor's own reference, which its driver shifts as it warms, is taken off the offset. Poses at
multiples of `measured_wall.FITTED_STEP_M` say what offset and gain are; the others, of which the
preset knows nothing, judge it.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from measured_wall import NEAREST_DELAY_M, Wall, read_wall, reference_delay
from scipy.constants import c

import spisim
from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture
from spisim.base.config import dump_yaml
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.scene.load import make_scene
from spisim_inverse.fit.fitting import fit
from spisim_paper.checks import Check, Table

OFFSET, GAIN, DARK = (
    "spots.range_offset_m",
    "zones.power_w",
    "tof.detector.sensor.dark_count_rate_hz",
)
SPP = 32
REFLECTANCE, SIDE_M, THICKNESS_M = 0.8, 4.0, 0.02
MAX_Z = 1.3
"""Maximum rms of what the other poses are off, over the stated sigma."""


@dataclass(frozen=True)
class Poses:
    """Estimates (poses, 2) of offset in metres and ln gain, with their sigmas."""

    distance_m: Floats
    fitted: Floats
    value: Floats
    sigma: Floats
    scale: Floats

    @property
    def z(self) -> Floats:
        """What each other pose is off from the weighted mean of the fitted ones, over its sigma."""
        known = self.fitted.astype(bool)
        weight = self.sigma[known] ** -2.0
        mean = (weight * self.value[known]).sum(axis=0) / weight.sum(axis=0)
        other = ~known
        return (self.value[other] - mean) / np.sqrt(self.sigma[other] ** 2 + 1 / weight.sum(axis=0))


def wall_poses(folder: Path, quick: bool) -> Poses:
    """Fits of poses of a folder, beyond the near overlap of the lenses."""
    wall = read_wall(folder)
    wall = wall.at(wall.distance_m >= NEAREST_DELAY_M - 1e-9)
    known = np.flatnonzero(wall.fitted)[:: 4 if quick else 2]
    other = np.flatnonzero(~wall.fitted)[:: 3 if quick else 1]
    wall = wall.at(np.sort(np.concatenate([known, other])))
    instrument = spisim.load_instrument("tmf8820")
    rows = [pose(wall, number, instrument) for number in range(wall.distance_m.size)]
    value, sigma, scale = (np.array(each) for each in zip(*rows, strict=True))
    return Poses(wall.distance_m, wall.fitted, value, sigma, scale)


def pose(wall: Wall, number: int, instrument: Instrument) -> tuple[list[float], list[float], float]:
    """Offset and ln gain of a pose, their sigmas, and the scale of these."""
    scene = board(float(wall.distance_m[number]))
    capture = recorded(wall.histograms[number], scene, instrument)
    result = fit(capture, scene, instrument, dict.fromkeys([OFFSET, GAIN, DARK]), spp=SPP)
    offset, gain, _ = result.estimates
    reference_m = c * instrument.ranging.tof.bin_width_s / 2 * reference_delay(wall)[number, 0]  # type: ignore[attr-defined]
    value = [offset.value - float(reference_m), float(np.log(gain.value))]
    sigmas = [offset.sigma, gain.log_sigma]
    print("wall", scene.name, value, sigmas, result.scale[:2], file=sys.stderr)
    return value, sigmas, float(result.scale[0])


def board(distance_m: float) -> Scene:
    """A white board square to the sensor, in the dark."""
    fields = {
        "name": f"board at {distance_m:.3f} m",
        "drone": {"position_m": [0, 0, 0], "look_at_m": [0, 1, 0]},
        "objects": [
            {
                "name": "board",
                "shape": "box",
                "size_m": [SIDE_M, THICKNESS_M, SIDE_M],
                "translate_m": [0, distance_m + THICKNESS_M / 2, 0],
                "material": "board",
            }
        ],
        "materials": {"board": {"reflectance": REFLECTANCE, "source": "assumed"}},
    }
    return make_scene(dump_yaml(fields), Path(), "board", wavelength_nm=940.0)


def recorded(histograms: Floats, scene: Scene, instrument: Instrument) -> Capture:
    """The measured histograms (zones, bins) as a capture of the preset."""
    like = spisim.simulate(scene, instrument, spp=8).capture
    assert like.spots is not None
    spots = replace(like.spots, counts=histograms[None].astype(np.int32))  # type: ignore[call-arg]
    return replace(like, spots=spots, provenance=replace(like.provenance, source="hardware"))


def wall_table(poses: Poses) -> Table:
    """What each kind of pose says."""
    rows = []
    for name, some in (("fitted", poses.fitted), ("others", ~poses.fitted)):
        offsets, gains = poses.value[some].T
        sigmas = np.median(poses.sigma[some], axis=0)
        rows.append(
            (
                name,
                str(np.count_nonzero(some)),
                f"{1e3 * offsets.mean():.2f}, {1e3 * offsets.std():.2f}",
                f"{1e3 * sigmas[0]:.2f}",
                f"{np.exp(gains.mean()):.3f}, {100 * gains.std():.1f} %",
                f"{100 * sigmas[1]:.1f} %",
                f"{np.median(poses.scale):.0f}",
            )
        )
    heads = (
        "poses", "number", "offset, mm: mean, scatter", "stated sigma, mm",
        "gain, W: mean, scatter", "stated sigma", "offset's sigma over noise",
    )  # fmt: skip
    return Table(
        "A wall measured by a TMF8820, 160 to 400 mm away, each pose by itself.", heads, rows
    )


def wall_checks(poses: Poses) -> list[Check]:
    """Offset and gain of the other poses lie within the stated sigma of those that were fitted."""
    rms = np.sqrt(np.mean(poses.z**2, axis=0))
    return [
        Check(f"wall: rms error of the {name} over sigma", float(each), MAX_Z)
        for name, each in zip(("offset", "gain"), rms, strict=True)
    ]
