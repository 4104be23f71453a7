"""What a pass of the light transport records."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from reconstruction.base.errors import InputError
from spisim.transport.engine.path_weights import PathWeight, WeightedTally
from spisim.transport.engine.tally import (
    HistogramTally,
    ImageTally,
    MakeTally,
    OrderTally,
    PathLengthBins,
    PhasorTally,
    Tallies,
)

#: Single precision resolves path lengths of 100 m to 0.1 mm: 1/300 of a period.
MAX_FREQUENCY_HZ = 1e10


@dataclass(frozen=True)
class Outputs:
    """What to record of the image's light besides the transport image itself.

    Parameters
    ----------
    orders
        Also split each output into unscattered, singly and multiply scattered light.
    frequencies_hz
        Modulation frequencies of the phasor images, Hz.
    bins
        Path-length bins of the transport cube; None for no cube.
    weights
        Sums of weighted light that are recorded beside every other output, named
        ``<output>_<weight>``.

    Raises
    ------
    InputError
        If single precision of the path length cannot resolve a frequency.
    """

    orders: bool = False
    frequencies_hz: tuple[float, ...] = ()
    bins: PathLengthBins | None = None
    weights: tuple[PathWeight, ...] = ()

    def __post_init__(self) -> None:
        for frequency_hz in self.frequencies_hz:
            if not 0 <= frequency_hz <= MAX_FREQUENCY_HZ:
                raise InputError(
                    f"frequencies_hz has {frequency_hz:g}: path lengths, accurate to 0.1 mm, "
                    f"resolve phases from 0 to {MAX_FREQUENCY_HZ:g} Hz"
                )

    def tallies(self, cells: int, replicas: int) -> Tallies:
        """Empty tallies for one launch."""
        kinds: list[MakeTally] = [ImageTally]
        if self.frequencies_hz:
            kinds.append(partial(PhasorTally, frequencies_hz=self.frequencies_hz))
        if self.bins is not None:
            kinds.append(partial(HistogramTally, bins=self.bins))
        if self.orders:
            kinds = [partial(OrderTally, make=kind) for kind in kinds]
        every = [*kinds, *weighted(kinds, self.weights)]
        return Tallies(cells, every, replicas, weighted=bool(self.weights))


def weighted(kinds: Sequence[MakeTally], weights: Sequence[PathWeight]) -> list[MakeTally]:
    """All kinds of tallies, with each weight."""
    return [partial(WeightedTally, make=kind, weight=each) for each in weights for kind in kinds]
