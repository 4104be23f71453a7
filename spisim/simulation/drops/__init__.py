"""Single drops and flakes that cross the beams while a frame is recorded.

Rain takes a few percent of the light within the range of the instrument, so its effect is a small
change to the light traced without it: drops block light on its way out and back, and scatter some
of it into the detectors, once.
"""

from spisim.simulation.drops.beams import on_spots
from spisim.simulation.drops.buckets import Interpolation, on_buckets
from spisim.simulation.drops.falling import FallingDrops, falling_drops
from spisim.simulation.drops.field import drop_field

__all__ = ["FallingDrops", "Interpolation", "drop_field", "falling_drops", "on_buckets", "on_spots"]
