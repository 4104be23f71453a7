"""Video: frames that show different patterns and remember each other, against single frames.

    python benchmarks/video.py [--quick] [--json] [--markdown]

Preset `paper`, and the same with an amplifier of a tenth of the noise; eight interleaved frames.
Still scenes: the image after eight frames, against that of one frame with all of their patterns.
The shipped flight through the warehouse, 16 frames in a row from several instants on, and cuts from
scene to scene: each image against that of its frame alone, and against that of a plain frame, of as
many patterns that are not interleaved. In decibels of squared errors; the true image of a frame is
its mean. `--markdown` pastes the tables into docs/results/video.md.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import yaml
from options import benchmark_options, finish

import spisim
from reconstruction import Capture, Reconstructor
from reconstruction.base.arrays import Floats
from reconstruction.capture import Provenance
from spisim.base.config import parse_model
from spisim.instrument import Instrument
from spisim.scene import Scene, at_drone_state, load_trajectory
from spisim.simulation.light import LightSequence
from spisim.simulation.light.sequence import trace
from spisim.simulation.measurement.buckets import record_buckets
from spisim.simulation.measurement.light import bucket_light
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "video.md"
STILLS = ("rubble", "person", "tunnel", "warehouse")
INSTANTS_S = (2.0, 0.5, 3.5, 5.0)
FRAMES, CYCLE = 16, 8
STAY = 4
"""Frames from one cut to the next."""
SEEDS = 2
FRACTIONS = (0.0, 0.5, 1.0)
USUAL = 0.5
METHODS = ("least-squares", "edge-preserving")
NEAR_DB, GAIN_DB, NEVER_DB = -0.3, 1.0, -0.05
"""What a still scene may lack of all at once; what a flight gains, and what no frame loses."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A capture without spots, and the true images (F, H, W) of its frames."""

    capture: Capture
    truth: Floats


@dataclass(frozen=True)
class Gains:
    """Decibels by which images of a video are better, frame by frame (F,).

    ``over_single``: than those of the same frames alone; ``over_plain``: than those of frames that
    are not interleaved.
    """

    over_single: Floats
    over_plain: Floats


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "one scene, one instant, one fraction, fewer paths", PAGE)
    paper = spisim.load_instrument("paper")
    names, instants = (STILLS[:1], INSTANTS_S[:1]) if options.quick else (STILLS, INSTANTS_S)
    spp = 16 if options.quick else 64
    stills = [traced(spisim.load_scene(name), paper, 1, spp) for name in names]
    path, position = load_trajectory("warehouse-flight"), spisim.load_scene("warehouse")
    flights = [
        traced(at_drone_state(position, path.drone_state(at_s)), paper, FRAMES, spp)
        for at_s in instants
    ]
    kinds = [(fraction, METHODS[0]) for fraction in FRACTIONS] + [(USUAL, METHODS[1])]
    if options.quick:
        kinds = [(USUAL, METHODS[0])]
    rows: list[tuple[str, ...]] = []
    checks: list[Check] = []
    for noise, instrument in (("paper", paper), ("a tenth", with_noise(paper, 0.1))):
        for fraction, method in kinds:
            dealt = with_plan(instrument, interleave=CYCLE, common=fraction)
            behind = np.array([after_a_cycle(light, instrument, dealt, method) for light in stills])
            flight = together(flown(light, instrument, dealt, method) for light in flights)
            cuts = cut(stills, instrument, dealt, method)
            rows.append((noise, f"{fraction:g}", method, *figures(behind, flight, cuts)))
            if fraction == USUAL:
                checks += promised(f"{method}, noise: {noise}", behind, flight, cuts)
    columns: tuple[str, ...] = ("noise", "common", "method", "still, over all at once")
    for film in ("flight", "cuts"):
        columns += tuple(
            f"{film}, {what}" for what in ("over single frames", "minimum", "over plain frames")
        )
    title = "Gain in dB, mean unless minimum, by the fraction of common patterns:"
    tables = [Table(title, columns, rows), costs(flights[0], with_plan(paper, interleave=CYCLE))]
    around = surroundings(("spisim", "mitsuba", "numpy", "scipy"))
    return finish(options, PAGE, "benchmark", around, tables, checks)


def figures(behind: Floats, flight: Gains, cuts: Gains) -> tuple[str, ...]:
    """Cells of a row."""
    cells = [behind.mean()]
    for gains in (flight, cuts):
        cells += [gains.over_single.mean(), gains.over_single.min(), gains.over_plain.mean()]
    return tuple(f"{cell:+.2f}" for cell in cells)


def promised(of: str, behind: Floats, flight: Gains, cuts: Gains) -> list[Check]:
    """What is promised for the usual fraction."""
    reported = {
        "still, after 8 frames over all at once, minimum of all scenes": (behind.min(), NEAR_DB),
        "flight over single frames": (flight.over_single.mean(), GAIN_DB),
        "flight over plain frames": (flight.over_plain.mean(), GAIN_DB),
        "flight over single frames, minimum": (flight.over_single.min(), NEVER_DB),
        "cuts over single frames, minimum": (cuts.over_single.min(), NEVER_DB),
    }
    return [
        Check(f"{name}, dB, {of}", float(value), limit, at_least=True)
        for name, (value, limit) in reported.items()
    ]


def traced(scene: Scene, instrument: Instrument, frames: int, spp: int) -> LightSequence:
    """Light of so many frames."""
    return trace(
        scene, instrument, frames=frames, spp=spp, transport_noise_share=None, seed=1, progress=None
    )


def recorded(light: LightSequence, instrument: Instrument, frames: int, seed: int) -> Recording:
    """What an instrument records of light."""
    mean = bucket_light(instrument, light, frames)
    buckets, _ = record_buckets(instrument, mean, np.random.default_rng(seed))
    plan, *following_plans = instrument.pattern_plans[:frames]
    provenance = Provenance("simulation", "benchmark", "", instrument.text, seed=seed)
    capture = Capture(plan, buckets, None, None, provenance, following_plans=tuple(following_plans))
    return Recording(capture, np.broadcast_to(mean.image, (frames, *mean.image.shape[1:])))


def errors(recording: Recording, method: str) -> Floats:
    """Mean squared error of every frame (F,)."""
    capture = recording.capture
    results = Reconstructor(capture.setup, image=method).batch(capture.batch(0, capture.frames))
    images = np.array([result.images[method] for result in results])
    return np.asarray(((images - recording.truth) ** 2).mean(axis=(1, 2)))


def decibels(over: Floats, errors: Floats) -> Floats:
    """By how much errors are less."""
    return np.asarray(10 * np.log10(over / errors))


def compared(dealt: Recording, plain: Recording, method: str) -> Gains:
    """A video, and one of plain frames of the same scenes with the same noise."""
    video = errors(dealt, f"recursive:{method}")
    single, without = errors(dealt, method), errors(plain, method)
    return Gains(decibels(single, video), decibels(without, video))


def together(many: Any) -> Gains:
    """Frames of several videos."""
    gains = list(many)
    return Gains(
        np.concatenate([each.over_single for each in gains]),
        np.concatenate([each.over_plain for each in gains]),
    )


def after_a_cycle(
    light: LightSequence, instrument: Instrument, dealt: Instrument, method: str
) -> float:
    """Gain of a still scene's image after a cycle over that of all patterns in one frame."""
    patterns = np.unique(np.concatenate([plan.index for plan in dealt.pattern_plans])).size
    whole = with_plan(instrument, patterns=int(patterns))
    video = f"recursive:{method}"
    last = [errors(recorded(light, dealt, CYCLE, seed), video)[-1] for seed in range(SEEDS)]
    once = errors(recorded(light, whole, 2 * SEEDS, SEEDS), method)  # each frame by itself
    return float(decibels(np.mean(once), np.mean(last)))


def flown(light: LightSequence, instrument: Instrument, dealt: Instrument, method: str) -> Gains:
    """Gains of a part of the flight."""
    films = (recorded(light, carried, FRAMES, 0) for carried in (dealt, instrument))
    return compared(*films, method)


def cut(
    stills: Sequence[LightSequence], instrument: Instrument, dealt: Instrument, method: str
) -> Gains:
    """Gains of a video that stays in each scene for a few frames."""
    frames = STAY * len(stills)
    displayed = np.repeat(np.arange(len(stills)), STAY)

    def edited(carried: Instrument) -> Recording:
        films = [recorded(light, carried, frames, seed) for seed, light in enumerate(stills)]
        first = films[0].capture
        counts, saturated = (
            np.array([getattr(films[k].capture.buckets, name)[t] for t, k in enumerate(displayed)])
            for name in ("counts", "saturated")
        )
        buckets = replace(first.buckets, counts=counts, saturated=saturated)
        truth = np.array([films[k].truth[t] for t, k in enumerate(displayed)])
        return Recording(replace(first, buckets=buckets), truth)

    return compared(edited(dealt), edited(instrument), method)


def costs(light: LightSequence, dealt: Instrument) -> Table:
    """Processor time of a frame, and by how much its image is late."""
    recording = recorded(light, dealt, FRAMES, 0)
    setup, truth = recording.capture.setup, recording.truth
    back = truth[:-1] - truth[1:]  # from each frame to the one before it
    late: dict[str, float] = {}
    rows = []
    for method in (*METHODS, *(f"recursive:{name}" for name in METHODS)):
        reconstructor = Reconstructor(setup, image=method)
        reconstructor.batch(recording.capture.batch(0, FRAMES))  # compiled
        times, images = [], []
        for frame in range(FRAMES):
            readings = recording.capture.frame(frame)
            began = thread_time()
            images.append(reconstructor(readings).images[method])
            times.append(thread_time() - began)
        late[method] = np.sum((np.array(images)[1:] - truth[1:]) * back) / np.sum(back**2)
        delay = late[method] - late[method.removeprefix("recursive:")]
        rows.append((method, f"{1e3 * np.median(times):.1f}", f"{delay:+.2f}"))
    title = (
        "A frame of the flight: processor time from readings to image, and by how many frames the "
        "image is later than that of the frame alone:"
    )
    return Table(title, ("method", "ms", "frames later"), rows)


def with_plan(instrument: Instrument, **changes: Any) -> Instrument:
    """The instrument with another pattern plan."""
    fields = yaml.safe_load(instrument.text)
    fields["plan"] |= changes
    return parse_model(yaml.safe_dump(fields), Instrument, "plan of the benchmark")


def with_noise(instrument: Instrument, factor: float) -> Instrument:
    """The instrument with an amplifier of so many times the noise."""
    fields = yaml.safe_load(instrument.text)
    fields["detector"]["amplifier"]["noise_pa_per_sqrt_hz"] *= factor
    return parse_model(yaml.safe_dump(fields), Instrument, "amplifier of the benchmark")


if __name__ == "__main__":
    sys.exit(main())
