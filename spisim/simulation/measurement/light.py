"""Mean photo-electrons of every bucket reading, before any noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.operators import expose
from spisim.instrument import Instrument, Modulation
from spisim.instrument.demodulation import PICTURE_HARMONICS
from spisim.instrument.model import Source
from spisim.simulation.drops import FallingDrops, Interpolation, on_buckets
from spisim.simulation.light import Light, Transport
from spisim.simulation.measurement.electronics import (
    Memory,
    carried_over,
    slow_part,
    with_carry_over,
)

#: Phases at which the windows of taps are tabulated for light of any path length.
PHASES = 721


@dataclass(frozen=True, eq=False)
class BucketLight:
    """Mean primary electrons per exposure, dark current and daylight included.

    `image` (T, H, W) is what each virtual pixel adds to one exposure when it is switched from off
    to on, averaged over each frame, or once for all if nothing moves; `image_error` is the standard
    error of its light transport.
    """

    image: Floats
    image_error: Floats
    buckets: Floats  # (frames, M)
    taken_off: Floats  # (frames, M): what an AC-coupled amplifier removes
    taps: Floats | None  # (frames, M, taps), if the projector is modulated
    after: Memory | None = None  # state at the start of the next frame


def bucket_light(
    instrument: Instrument,
    light: Light,
    frames: int,
    drops: Sequence[FallingDrops] = (),
    *,
    first: int = 0,
    before: Memory | None = None,
) -> BucketLight:
    """Electrons from the fractions of emitted power that the light transport found.

    Falling drops change the readings; the image is that without them. `first` is the index of the
    first frame, which selects its patterns. `before` is the state that the previous frame left; by
    default the first frame follows itself.
    """
    between = light.between(instrument.exposure_times_s(frames))
    electrons = instrument.pixel_powers_w * _gain(instrument, "projector")
    switched = pixel_electrons(instrument)
    imaged = between.until(frames if len(light.transports) > 1 else 1)
    images, errors = (
        np.array([getattr(key, name) for key in light.transports])
        for name in ("image", "image_error")
    )
    steady = background_electrons(instrument, [key.daylight_w for key in light.transports])

    modulation = instrument.imaging.projector.modulation
    pictures, steadies = images[None], steady[None]
    if modulation is not None:
        by_tap = tap_images(instrument, modulation, light.transports)  # (taps, keys, H, W)
        pictures = np.concatenate([pictures, by_tap])
        by_tap_steady = np.tile(modulation.taps.fraction * steady, (len(by_tap), 1))
        steadies = np.concatenate([steadies, by_tap_steady])
    pictures = pictures * electrons
    changes = on_buckets(drops, pictures, between, electrons, _response(instrument))
    settled = [
        _readings(instrument, between, first, *window)
        for window in zip(pictures, steadies, changes, strict=True)
    ]
    fraction = carried_fraction(instrument)
    last = [None] * len(settled) if before is None else before.light.tolist()
    buckets, *taps = (
        with_carry_over(each, fraction, each_last)
        for each, each_last in zip(settled, last, strict=True)
    )
    taken_off, level = np.zeros_like(buckets), 0.0
    if (amplifier := instrument.imaging.detector.amplifier) is not None:
        taken_off, level = slow_part(
            buckets,
            amplifier,
            instrument.pattern_period_s,
            None if before is None else before.level,
        )
    return BucketLight(
        image=imaged.means(images) * switched,
        image_error=imaged.means(errors) * switched,
        buckets=buckets,
        taken_off=taken_off,
        taps=np.stack(taps, axis=-1) if taps else None,
        after=Memory(level, np.array([each[-1, -1] for each in settled])),
    )


def no_light(frames: int, images: int) -> BucketLight:
    """Light without a projector: a dark pixel in each of the `images`."""
    image, readings = np.zeros((images, 1, 1)), np.zeros((frames, 1))
    return BucketLight(image, image, readings, readings, None)


def pixel_electrons(instrument: Instrument) -> Floats:
    """Electrons of one exposure (H, W) that a pixel adds if all its light reaches an aperture."""
    fully_on = instrument.pixel_powers_w * _gain(instrument, "projector")
    return np.asarray((1 - instrument.imaging.projector.dark_level) * fully_on)


def background_electrons(instrument: Instrument, daylight_w: ArrayLike) -> Floats:
    """Electrons of one exposure from dark current and this much daylight on the apertures."""
    dark = instrument.imaging.detector.dark_electrons(instrument.imaging.exposure_time_s)
    daylight = np.asarray(daylight_w) * _gain(instrument, "daylight")
    return daylight + len(instrument.imaging.detector.positions_m) * dark


def tap_images(
    instrument: Instrument, modulation: Modulation, transports: tuple[Transport, ...]
) -> Floats:
    """Transport images as each tap sees them, (taps, keys, H, W), from the phasor images."""
    amplifier = instrument.imaging.detector.amplifier
    assert amplifier is not None
    orders, amplitudes = modulation.amplitudes(
        modulation.frequencies_hz[0], amplifier.response, PICTURE_HARMONICS
    )
    phases = modulation.taps.phases_rad
    turns = amplitudes[:, None] * np.exp(-1j * orders[:, None] * phases)  # (orders, taps)
    phasors = np.array([key.extra["phasors"] for key in transports])  # (keys, orders, H, W)
    waves = np.einsum("nt,knhw->tkhw", turns, phasors).real
    images = np.array([key.image for key in transports])
    return np.asarray(modulation.taps.fraction * (images + waves))


def _response(instrument: Instrument) -> Callable[[Floats], Floats]:
    """Fraction of light of a path length in m (n,) that bucket and taps collect, (1 + taps, n)."""
    modulation, amplifier = (
        instrument.imaging.projector.modulation,
        instrument.imaging.detector.amplifier,
    )
    if modulation is None:
        return lambda length_m: np.ones((1, len(length_m)))
    assert amplifier is not None
    frequency = modulation.frequencies_hz[0]
    phases = np.linspace(0, 2 * np.pi, PHASES)
    windows = modulation.correlation(phases, frequency, amplifier.response)

    def response(length_m: Floats) -> Floats:
        phase = np.mod(2 * np.pi * frequency / c * length_m, 2 * np.pi)
        taps = [np.interp(phase, phases, window) for window in windows]
        return np.array([np.ones(len(length_m)), *taps])

    return response


def _readings(
    instrument: Instrument,
    between: Interpolation,
    first: int,
    images: Floats,
    steady: Floats,
    change: Floats,
) -> Floats:
    """Exposures (frames, M) of images (keys, H, W), steady light (keys,) and a change of them.

    Nothing is carried over from one to the next.
    """
    dark = instrument.imaging.projector.dark_level
    total = images.sum(axis=(1, 2))[:, None]
    readings = change.copy()
    plans = instrument.pattern_plans
    for turn in range(min(len(plans), len(readings))):
        plan = plans[(first + turn) % len(plans)]
        leaked = dark * total * plan.factors
        light = (1 - dark) * expose(plan, images) + leaked + steady[:, None]  # (keys, M)
        frames = slice(turn, None, len(plans))
        nearby = light[between.keys[frames], np.arange(plan.exposures)[:, None]]
        readings[frames] += (between.fractions[frames] * nearby).sum(axis=-1)
    return readings


def carried_fraction(instrument: Instrument) -> float:
    """Fraction of a reading that belongs to the exposure before."""
    amplifier = instrument.imaging.detector.amplifier
    pole_s = 0.0 if amplifier is None else amplifier.time_constant_s
    return carried_over(
        (instrument.imaging.projector.settling_time_s, pole_s),
        instrument.imaging.exposure_time_s,
        instrument.pattern_period_s,
    )


def _gain(instrument: Instrument, source: Source) -> float:
    """Electrons per exposure and watt on the bucket detector's aperture."""
    per_joule = instrument.electrons_per_joule(instrument.imaging.detector, source)
    return per_joule * instrument.imaging.exposure_time_s
