"""Direct time of flight of several surfaces: histogram -> all pulses -> path lengths."""

from dataclasses import replace

import numpy as np

from ...base.constants import c
from ...base.errors import InputError
from ...capture import Optics, Spots
from ...capture.readings.dtof import HistogramSpots
from ..brightness import Brightness
from ..method import RangingSolver
from ..ranges import Alternative, Paths, Ranges, range_from_path, ranges_from_paths
from ..returns import Return, find_returns
from ..shape import PulseShape, shape_of
from .dtof import NO_PILE_UP


class Returns:
    """All pulses in the histogram (see `find_returns`); the strongest is the range.

    The others are alternatives, weighed by their fraction of the light.
    """

    title = "all pulses"
    reads = HistogramSpots

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver for a recording's histograms.

        Raises InputError if neither the response nor its width is known.
        """
        assert isinstance(spots, HistogramSpots)
        shape = shape_of(spots)
        if shape is None:
            raise InputError(
                "ranging method 'returns' needs spots/response_sigma_s or spots/response; 'dtof' "
                "fits the width of one pulse"
            )

        def solve(spots: Spots, brightness: Brightness | None = None) -> Ranges:
            assert isinstance(spots, HistogramSpots)
            return _solve(spots, shape)

        return solve

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range beyond which a spot appears nearer than it is."""
        return np.inf


def _solve(spots: HistogramSpots, shape: PulseShape) -> Ranges:
    cycles = spots.pulses if spots.piles_up else NO_PILE_UP * spots.pulses
    found = [find_returns(each, cycles, shape) for each in spots.counts[0].astype(np.float64)]
    nothing = Return(np.nan, np.nan, 0.0)
    first = np.array([pulses[0] if pulses else nothing for pulses, _ in found])
    offset = (spots.start_s - spots.delay_offset_s) / spots.bin_width_s
    paths = Paths(
        path_m=c * spots.bin_width_s * (first[:, 0] + offset),
        sigma_m=c * spots.bin_width_s * first[:, 1],
        signal_electrons=cycles * first[:, 2],
        background_electrons=np.array([cycles * background for _, background in found]),
        saturated=spots.saturated[0],
        no_signal=np.isnan(first[:, 0]),
        ambiguous=(first[:, 0] < 0) | (first[:, 0] > spots.counts.shape[-1]),
    )
    alternatives = tuple(
        _alternatives(spots, spot, pulses, offset) for spot, (pulses, _) in enumerate(found)
    )
    return replace(ranges_from_paths(paths, spots), alternatives=alternatives)


def _alternatives(
    spots: HistogramSpots, spot: int, pulses: list[Return], offset: float
) -> tuple[Alternative, ...]:
    if not pulses:
        return ()
    delay, sigma, arrivals = np.transpose(pulses)
    path_m = c * spots.bin_width_s * (delay + offset)
    range_m, slope = range_from_path(
        path_m, spots.directions[spot], spots.detector_positions_m[spot]
    )
    sigma_m = slope * c * spots.bin_width_s * sigma
    weight = arrivals / arrivals.sum()
    columns = zip(range_m.tolist(), sigma_m.tolist(), weight.tolist(), strict=True)
    return tuple(map(Alternative._make, columns))


METHOD = Returns()
