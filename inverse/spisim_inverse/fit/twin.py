"""The twin of a recording: scene, instrument and calibration that should make its readings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from reconstruction import Capture
from reconstruction.base.errors import InputError
from reconstruction.capture.readings.dtof import HistogramSpots
from spisim.instrument import Instrument
from spisim.scene import Scene


@dataclass(frozen=True)
class Scale:
    """Counts of electrons: counts = offset_counts + electrons / electrons_per_count."""

    electrons_per_count: float
    offset_counts: float


@dataclass(frozen=True, eq=False)
class Twin:
    """Scene and instrument as files describe them, and what only a calibration shows.

    Attributes
    ----------
    scene, instrument
        As of `spisim.load_scene` and `spisim.load_instrument`.
    buckets, spots
        Scales of the readings of patterns and of spots; None where there are none, and for
        histograms, which count.
    range_offset_m
        What is added to all ranges of spots.
    """

    scene: Scene
    instrument: Instrument
    buckets: Scale | None
    spots: Scale | None
    range_offset_m: float = 0.0
    values: dict[str, float] = field(default_factory=dict)
    """Values of parameters so far, by name."""

    @classmethod
    def of(cls, scene: Scene, instrument: Instrument, capture: Capture) -> Twin:
        """With the scales that a capture states.

        Raises InputError for what has no single light: scenes that move, single drops and steered
        spots, and for readings of unknown scale.
        """
        if scene.moves or scene.precipitation:
            what = "moves" if scene.moves else "has single drops"
            raise InputError(f"scene {scene.name} {what}; a fit needs a scene at rest without them")
        if capture.spots is not None and capture.spots.pointing is not None:
            raise InputError("steered spots cannot be fitted: record fixed ones")
        buckets = spots = None
        if capture.plan.shows_image:
            if capture.buckets.unit == "count":
                raise InputError(
                    "buckets/electrons_per_count is unknown (nan): state it when importing, and "
                    "free it where it is a guess"
                )
            own: Any = capture.buckets
            buckets = Scale(own.electrons_per_count, own.offset_counts)
        if capture.spots is not None and not isinstance(capture.spots, HistogramSpots):
            charge: Any = capture.spots
            spots = Scale(charge.electrons_per_count, charge.offset_counts)
        return cls(scene, instrument, buckets, spots)

    def restated(self, capture: Capture) -> Capture:
        """A capture with the calibration of this twin, in place of that which it states."""
        buckets: Any = capture.buckets
        if self.buckets is not None:
            buckets = replace(capture.buckets, **vars(self.buckets))
        spots: Any = capture.spots
        if self.spots is not None:
            spots = replace(spots, **vars(self.spots))
        return replace(capture, buckets=buckets, spots=spots)
