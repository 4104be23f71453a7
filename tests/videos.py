"""Recordings of several frames, and images of them with what earlier frames tell and without."""

import numpy as np

from reconstruction import Capture, Reconstructor
from reconstruction.capture import Buckets, Provenance
from reconstruction.operators import expose, interleaved, make_plan

METHODS = ("least-squares", "recursive:least-squares")


def cycle_of(shape, patterns, frames, common=0.5, polarity="single-ended"):
    """Plans of successive frames with so many patterns each."""
    shared = max(1, round(common * patterns))
    whole = make_plan(shape, shared + frames * (patterns - shared), polarity=polarity)
    return interleaved(whole, frames, shared)


def video(images, plans, noise, seed=0):
    """A recording of images (F, H, W), with white noise of known size in each reading."""
    rng = np.random.default_rng(seed)
    readings = np.array([expose(plans[t % len(plans)], image) for t, image in enumerate(images)])
    return Capture(
        plan=plans[0],
        following_plans=tuple(plans[1:]),
        buckets=Buckets(
            counts=readings + rng.normal(0, noise, readings.shape),
            saturated=np.zeros(readings.shape, bool),
            exposure_time_s=60e-6,
            pattern_period_s=67e-6,
            electrons_per_count=1.0,
            offset_counts=0.0,
            noise_electrons=noise,
            excess_noise_factor=1e-9,
            dead_time_s=0.0,
        ),
        spots=None,
        optics=None,
        provenance=Provenance("hardware", "test", "", ""),
    )


def gains_db(capture, images, methods=METHODS):
    """By how much the second method's squared error is below the first one's, (F,)."""
    results = Reconstructor(capture.setup, image=methods).batch(capture.batch(0, capture.frames))
    errors = [
        [np.mean((result.images[name] - image) ** 2) for name in methods]
        for result, image in zip(results, images, strict=True)
    ]
    one, other = np.transpose(errors)
    return 10 * np.log10(one / other)
