"""What about an instrument in a scene its user should know, besides what the capture tells."""

import numpy as np

from spisim.budget import background_warnings, instrument_warnings
from spisim.instrument import Instrument
from spisim.measurement.light import background_electrons
from spisim.measurement.spots import spot_light
from spisim.transport import LightSequence, Transport

#: Error of a transport image, ‖errors‖ / ‖image‖, above which it is no truth to compare with.
TRUE_ERROR = 0.1


def simulation_warnings(instrument: Instrument, light: Transport) -> list[str]:
    """Sentences about eye safety, timing, detectors that the background alone overwhelms, truth."""
    still = LightSequence(np.zeros(1), (light,))
    return [
        *instrument_warnings(instrument),
        *background_warnings(
            instrument,
            float(background_electrons(instrument, light.daylight_w)),
            float(spot_light(instrument, still, frames=1).steady_per_s.max()),
        ),
        *truth_warnings(light),
    ]


def truth_warnings(light: Transport) -> list[str]:
    """A sentence about a transport image that is too noisy to be taken for the truth."""
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
