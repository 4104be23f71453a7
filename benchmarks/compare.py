"""Causes that `spisim compare` names where two simulated captures differ, and its false alarms.

    python benchmarks/compare.py [--quick] [--json] [--markdown]

Drawn scenes of families on which no constant of the comparison was chosen, presets `paper` and
`fog`, in fog of 20 to 200 m of visibility; for power and pointing also in clear air. The captures
of a pair were traced with different seeds. They differ in nothing, in the power of projector,
lasers or both (5 %), in visibility (10 %), or in pointing (0.5° to any side). A pair counts as
named if the strongest cause is the right one. `--markdown` pastes the tables into
docs/results/comparing.md.
"""

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from intervals import of_fraction
from options import benchmark_options, finish

import spisim
from reconstruction import Capture
from reconstruction.capture.schema import between
from spisim.base.config import dump_yaml, parse_model
from spisim.instrument import Instrument
from spisim.scene import Scene, draw_scene
from spisim_compare.comparing import compare
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "comparing.md"
FAMILIES = ("landing-pad", "racing-gates", "stairwell", "targets", "shipyard")
PRESETS = ("paper", "fog")
KINDS = ("moderate-radiation", "heavy-radiation", "moderate-advection", "heavy-advection")
SCENES = 3
"""Drawn scenes of each family and preset, each in fog and in clear air."""
QUICK_FAMILIES = FAMILIES[1:2]
PAIRS, FRAMES = 4, 16
"""Pairs of each scene and cause, and frames of a capture."""
VISIBILITIES_M = 20.0, 200.0
POWER, VISIBILITY, TURN_DEG = 0.05, 0.10, 0.5
SPP = 24
MIN_NAMED, MAX_ALARMS = 0.90, 0.02
SIDES_DEG = 45.0 * np.arange(8)


@dataclass(frozen=True)
class Pair:
    """Outcome of a comparison: what was changed, and what was named; none without an alarm."""

    family: str
    preset: str
    scene: str
    foggy: bool
    changed: str
    named: str


def main() -> int:
    """Compare all pairs; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "a scene of one family", PAGE)
    around = surroundings(("spisim", "mitsuba", "drjit", "numpy", "scipy"))
    scenes = 1 if options.quick else SCENES
    families = QUICK_FAMILIES if options.quick else FAMILIES
    pairs = [
        pair
        for preset in PRESETS
        for family in families
        for number in range(scenes)
        for pair in pairs_of(family, preset, number)
    ]
    return finish(options, PAGE, "compare", around, tables(pairs), checks(pairs))


def pairs_of(family: str, preset: str, number: int) -> Iterator[Pair]:
    """All pairs of a scene."""
    rng = np.random.default_rng([FAMILIES.index(family), PRESETS.index(preset), number])
    low, high = np.log(VISIBILITIES_M)
    visibility_m = float(np.exp(rng.uniform(low, high)))
    fog = {"visibility_m": visibility_m, "kind": str(rng.choice(KINDS))}
    instrument = spisim.load_instrument(preset)
    for foggy in (True, False):
        air = fog if foggy else None
        first = recorded(drawn(family, number, air), instrument, 10 * number)
        for changed, (scene, other) in changes(family, number, air, instrument, rng).items():
            second = recorded(scene, other, 10 * number + 1)
            for one, two in zip(first, second, strict=True):
                verdict = compare(one, two).verdict
                named = verdict.explained[0].cause.family if verdict.explained else ""
                named = named or ("unexplained" if verdict.alarm else "")
                yield Pair(family, preset, f"{family} {preset} {number}", foggy, changed, named)


def changes(
    family: str, number: int, air: dict[str, Any] | None, instrument: Instrument, rng: Any
) -> dict[str, tuple[Scene, Instrument]]:
    """Scene and instrument of the second capture, by what was changed."""
    same = drawn(family, number, air)
    sign = float(rng.choice((-1, 1)))
    strength = 1 + POWER * sign
    projector, lasers = rng.permutation([(1, 0), (0, 1), (1, 1)])[0]
    result = {
        "equal": (same, instrument),
        "power": (same, powered(instrument, strength**projector, strength**lasers)),
        "pointing": (turned(same, rng.choice(SIDES_DEG)), instrument),
    }
    if air is not None:
        thicker = air | {"visibility_m": air["visibility_m"] * (1 + sign * VISIBILITY)}
        result["fog"] = (drawn(family, number, thicker), instrument)
    return result


def drawn(family: str, number: int, air: dict[str, Any] | None) -> Scene:
    """A scene in this air."""
    with warnings.catch_warnings(action="ignore"):  # some fog holds more water than natural one
        return draw_scene(family, 1000 + number, changes={"fog": air, "rain": None, "snow": None})


def powered(instrument: Instrument, projector: float, lasers: float) -> Instrument:
    """The instrument with other powers."""
    fields = yaml.safe_load(instrument.text)
    fields["projector"]["power_w"] *= float(projector)
    fields["lasers"]["power_w"] *= float(lasers)
    fields.pop("eye_safety", None)  # declared for the powers that it has
    return parse_model(dump_yaml(fields), Instrument, "instrument")


def turned(scene: Scene, side_deg: float) -> Scene:
    """The scene from a drone turned by `TURN_DEG` towards a side of the image."""
    angle, side = np.radians(TURN_DEG), np.radians(side_deg)
    axis = np.array([np.cos(side), np.sin(side), 0.0])
    x, y, _ = axis
    cross = np.array([[0, 0, y], [0, 0, -x], [-y, x, 0]])
    turn = np.eye(4)
    turn[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return replace(scene, drone_pose=scene.drone_pose @ turn)


def recorded(scene: Scene, instrument: Instrument, seed: int) -> list[Capture]:
    """`PAIRS` captures that differ in the detectors' noise alone."""
    whole = spisim.simulate(scene, instrument, spp=SPP, seed=seed, frames=PAIRS * FRAMES).capture
    starts = range(0, PAIRS * FRAMES, FRAMES)
    assert whole.spots is not None
    return [
        replace(
            whole,
            buckets=between(whole.buckets, start, start + FRAMES),
            spots=between(whole.spots, start, start + FRAMES),
        )
        for start in starts
    ]


def tables(pairs: list[Pair]) -> list[Table]:
    """What was named, by what was changed, air and preset."""
    names = ("power", "fog", "pointing", "offset", "background", "unexplained", "")
    columns = ("changed", "air", "preset", "pairs", *(f"{name or 'nothing'}, %" for name in names))
    rows = []
    for changed in ("equal", "power", "fog", "pointing"):
        for foggy in (True, False):
            for preset in PRESETS:
                some = [
                    pair.named
                    for pair in pairs
                    if (pair.changed, pair.foggy, pair.preset) == (changed, foggy, preset)
                ]
                if some:
                    fractions = (f"{100 * some.count(name) / len(some):.0f}" for name in names)
                    air = "fog" if foggy else "clear"
                    rows.append((changed, air, preset, str(len(some)), *fractions))
    title = (
        f"Named causes, per cent of the pairs; captures of {FRAMES} frames, "
        f"power {100 * POWER:.0f} %, visibility {100 * VISIBILITY:.0f} %, turn {TURN_DEG}°"
    )
    return [Table(title, columns, rows)]


def checks(pairs: list[Pair]) -> list[Check]:
    """Promises: right causes, and few alarms between equal captures."""
    result = []
    for changed in ("power", "fog", "pointing"):
        some = [pair for pair in pairs if pair.changed == changed]
        hits = [pair.named == changed for pair in some]
        interval = of_fraction(hits, [pair.scene for pair in some])
        result.append(Check(f"{changed} named", float(np.mean(hits)), MIN_NAMED, True, interval))
    equal = [pair for pair in pairs if pair.changed == "equal"]
    alarms = [pair.named != "" for pair in equal]
    interval = of_fraction(alarms, [pair.scene for pair in equal])
    result.append(Check("false alarms", float(np.mean(alarms)), MAX_ALARMS, interval=interval))
    return result


if __name__ == "__main__":
    sys.exit(main())
