"""Single drops and flakes that cross the beams while a frame is recorded.

Rain takes a few percent of the light within the range of the instrument, so its effect is a small
change to the light traced without it: drops block light on its way out and back, and scatter some
of it into the detectors, once.
"""

from spisim.transport.drops.beams import on_spots
from spisim.transport.drops.buckets import Interpolation, on_buckets
from spisim.transport.drops.falling import FallingDrops, falling_drops
from spisim.transport.drops.field import drop_field

__all__ = ["FallingDrops", "Interpolation", "drop_field", "falling_drops", "on_buckets", "on_spots"]
