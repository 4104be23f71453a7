"""What about an instrument in a scene its user should know, besides what the capture tells."""

import numpy as np

from spisim.budget import background_warnings, instrument_warnings
from spisim.instrument import Instrument
from spisim.measurement.light import background_electrons
from spisim.measurement.spots import spot_light
from spisim.transport import LightSequence, Transport


def simulation_warnings(instrument: Instrument, light: Transport) -> list[str]:
    """Sentences about eye safety, timing and detectors that the background alone overwhelms."""
    still = LightSequence(np.zeros(1), (light,))
    return [
        *instrument_warnings(instrument),
        *background_warnings(
            instrument,
            float(background_electrons(instrument, light.daylight_w)),
            float(spot_light(instrument, still, frames=1).steady_per_s.max()),
        ),
    ]
