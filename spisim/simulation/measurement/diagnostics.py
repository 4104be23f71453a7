"""Warnings about an instrument in a scene, besides those about the capture."""

import numpy as np

from spisim.budget import background_warnings, instrument_warnings
from spisim.instrument import Instrument
from spisim.simulation.light import LightSequence, Transport
from spisim.simulation.measurement.light import background_electrons
from spisim.simulation.measurement.spots import spot_light

#: Error of a transport image, ‖errors‖ / ‖image‖, above which it does not serve as truth.
TRUE_ERROR = 0.1


def simulation_warnings(instrument: Instrument, light: Transport) -> list[str]:
    """Warn about eye safety, timing, saturated detectors, and noise of light and truth."""
    still = LightSequence(np.zeros(1), (light,))
    bucket = spots = 0.0
    if instrument.images:
        bucket = float(background_electrons(instrument, light.daylight_w))
    if instrument.ranges:
        spots = float(spot_light(instrument, still, frames=1).steady_per_s.max())
    return [
        *instrument_warnings(instrument),
        *background_warnings(instrument, bucket, spots),
        *truth_warnings(light),
        *noise_share_warnings(light),
    ]


def noise_share_warnings(light: Transport) -> list[str]:
    """Warn about light that is noisier than the detectors that measure it."""
    fractions = {"image": light.noise_share, "spots": light.spot_noise_share}
    noisy = [f"{each:.2g} times in the {what}" for what, each in fractions.items() if each > 1]
    if not noisy:
        return []
    return [
        f"the light's own noise is above the detectors', {' and '.join(noisy)}: errors of images "
        "and ranges are those of too few light paths; more spp, or a transport_noise_share below "
        "1, makes it better"
    ]


def truth_warnings(light: Transport) -> list[str]:
    """Warn about a transport image that is too noisy to serve as truth."""
    tiny = float(np.finfo(np.float64).tiny)
    relative = float(np.linalg.norm(light.image_error)) / max(
        float(np.linalg.norm(light.image)), tiny
    )
    if relative <= TRUE_ERROR:
        return []
    return [
        f"the true image is known to {100 * relative:.0f} % only, which is good for readings but "
        "noisy to compare images with; more spp, or a smaller transport_noise_share, make it better"
    ]
