"""Ranges of zones, photons and thresholds in corners: where nothing is in reach, and of walls.

    python benchmarks/corner_phantoms.py [--quick]

Even fog of kinds and visibilities that no constant was chosen by, open, before a wall beyond the
gate, or before a wall within it, and clear air. Each capture is judged by the first of its
usual ranging methods.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from intervals import of_fraction
from spots_zones import Wall

from reconstruction import reconstruct
from reconstruction.base.arrays import Mask
from spisim.atmosphere import CLEAR, fog
from spisim.instrument import load_instrument
from spisim.scene import Ambient, Scene
from spisim.simulation import simulate
from spisim.simulation.chain import LightSource
from spisim_paper.checks import Check


class Corner(NamedTuple):
    """Distances of walls beyond the gate and within it, numbers of the fogs, and paths per spot.

    Too few paths leave rare bright ones, peaks that no fog has. Zones of many would take too long:
    None is the light of the surrogate, singly scattered with a fraction more.
    """

    beyond_m: float
    within_m: tuple[float, ...]
    fogs: range
    paths: int | None


CORNERS = {
    "tmf8820": Corner(3.0, (0.4, 0.7, 1.1, 1.5), range(0, 28, 5), 512),
    "vl53l5cx": Corner(6.0, (0.5, 1.2, 2.2, 3.6), range(0, 28, 5), None),
    "vl53l8cx": Corner(6.0, (0.5, 1.2, 2.2, 3.6), range(2, 28, 5), None),
    "rangefinder-905": Corner(60.0, (0.7, 1.3, 2.5, 9.0), range(0, 28, 5), 2048),
    "fog-spad": Corner(16.0, (0.9, 1.8, 3.3, 7.0), range(0, 7, 2), 32),
}
KINDS = "moderate-advection", "chu-hogg", "haze-h", "moderate-radiation"
VISIBILITIES_M = 10.0, 14.0, 27.0, 45.0, 80.0, 130.0, 200.0
QUICK_FOGS = 1, 4
#: Of the walls, in turn.
REFLECTANCES = 0.05, 0.2, 0.5, 0.9
WRONG_M, MAX_FRACTION = 0.3, 0.005


@dataclass(frozen=True)
class Place:
    """What a preset looks at: an open place without a wall; ``in_reach`` of its gate or not."""

    preset: str
    visibility_m: float | None
    kind: str
    wall_m: float | None
    reflectance: float
    in_reach: bool
    seed: int


@dataclass(frozen=True, eq=False)
class Record:
    """Which spots (spots,) of a capture have a range, and which of these are wrong.

    All are where nothing is in reach.
    """

    place: Place
    ranged: Mask
    wrong: Mask


def phantoms(quick: bool) -> list[Record]:
    """Records of all presets, fogs and walls."""
    return [_record(place, quick) for preset in CORNERS for place in _places(preset, quick)]


def _places(preset: str, quick: bool) -> Iterator[Place]:
    corner = CORNERS[preset]
    for number in QUICK_FOGS if quick else (*corner.fogs, -1):
        far_m = VISIBILITIES_M[number % len(VISIBILITIES_M)] if number >= 0 else None
        walls_m = [corner.within_m[(number + index) % len(corner.within_m)] for index in (0, 1)]
        nothing_m = corner.beyond_m if number % 2 else None
        for index, wall_m in enumerate((nothing_m, *walls_m[: 1 if quick else 2])):
            yield Place(
                preset,
                far_m,
                KINDS[number % len(KINDS)],
                wall_m,
                REFLECTANCES[(number // 2 + index) % len(REFLECTANCES)],
                index > 0,
                seed=7000 + 3 * number + index,
            )


def _record(place: Place, quick: bool) -> Record:
    instrument = load_instrument(place.preset)
    nm = float(instrument.wavelength_nm)
    wall = Wall(place.wall_m or np.inf, reflectance=place.reflectance)
    far_m = place.visibility_m
    scene = Scene(
        "corner",
        () if place.wall_m is None else (wall.thing("wall"),),
        CLEAR if far_m is None else fog(far_m, place.kind, wavelength_nm=nm),
        Ambient(),
        np.eye(4),
        wavelength_nm=nm,
    )
    paths = CORNERS[place.preset].paths
    light: LightSource = "surrogate" if quick or paths is None else "traced"
    capture = simulate(scene, instrument, light=light, spp=paths or 1, seed=place.seed).capture
    ranges = reconstruct(capture, depth=()).ranges
    assert ranges is not None
    assert capture.truth is not None
    right = np.abs(ranges.range_m - capture.truth.spot_range_m[0]) <= WRONG_M
    return Record(place, ranges.valid, ranges.valid & ~(right & place.in_reach))


def phantom_checks(records: Sequence[Record]) -> Iterator[Check]:
    """Fractions of spots with a range where nothing is, and of ranges of walls that are wrong."""
    for preset in CORNERS:
        own = [each for each in records if each.place.preset == preset]
        wrong = {
            "ranges of nothing": [each.wrong for each in own if not each.place.in_reach],
            "wrong ranges of walls": [
                each.wrong[each.ranged] for each in own if each.place.in_reach
            ],
        }
        for name, captures in wrong.items():
            hits = np.concatenate(captures)
            group = np.repeat(np.arange(len(captures)), [each.size for each in captures])
            yield Check(
                f"{preset}: {name}",
                float(hits.mean()) if hits.size else 0.0,
                MAX_FRACTION,
                interval=of_fraction(hits, group),
            )


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    records = phantoms("--quick" in sys.argv)
    checks = list(phantom_checks(records))
    for check in checks:
        print(f"{check.name}: {100 * check.value:.2f} % (at most {100 * check.limit:g} %)")
    for each in records:
        if each.wrong.any():
            print(f"{each.wrong.sum()} of {each.wrong.size} wrong: {each.place}")
    return int(any(check.value > check.limit for check in checks))


if __name__ == "__main__":
    sys.exit(main())
