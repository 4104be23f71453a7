"""What an instrument needs of a scene."""

import math

from spisim.instrument.model import Instrument
from spisim.scene.layout import Needs

#: Of the unambiguous range, for noise takes a spot's range beyond it.
WITHIN_RANGE = 0.98


def needs(instrument: Instrument) -> Needs:
    """Field, beams and detectors that a scene has to suit; see `layout_problem`."""
    projector, (lasers, tof) = instrument.imaging.projector, instrument.ranging
    return Needs(
        half_field_deg=(
            math.degrees(math.atan(projector.tan_half_width)),
            math.degrees(math.atan(projector.tan_half_height)),
        ),
        beams=lasers.directions,
        farthest_spot_m=WITHIN_RANGE * tof.unambiguous_range_m,
        min_spots=1,
        detectors_m=instrument.ranging.detector_positions_m,
        lens_ring_m=math.sqrt(tof.detector.aperture_area_m2 / (2 * math.pi)),
    )
