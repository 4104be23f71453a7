"""What a pass of the light transport records."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from reconstruction.base.errors import InputError
from spisim.transport.engine.tally import (
    HistogramTally,
    ImageTally,
    OrderTally,
    PathLengthBins,
    PhasorTally,
    Tallies,
    Tally,
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

    Raises
    ------
    InputError
        If single precision of the path length cannot resolve a frequency.
    """

    orders: bool = False
    frequencies_hz: tuple[float, ...] = ()
    bins: PathLengthBins | None = None

    def __post_init__(self) -> None:
        for frequency_hz in self.frequencies_hz:
            if not 0 <= frequency_hz <= MAX_FREQUENCY_HZ:
                raise InputError(
                    f"frequencies_hz has {frequency_hz:g}: path lengths, accurate to 0.1 mm, "
                    f"resolve phases from 0 to {MAX_FREQUENCY_HZ:g} Hz"
                )

    def tallies(self, cells: int, replicas: int) -> Tallies:
        """Empty tallies for one launch."""
        kinds: list[Callable[[int], Tally]] = [ImageTally]
        if self.frequencies_hz:
            kinds.append(partial(PhasorTally, frequencies_hz=self.frequencies_hz))
        if self.bins is not None:
            kinds.append(partial(HistogramTally, bins=self.bins))
        if self.orders:
            kinds = [partial(OrderTally, make=kind) for kind in kinds]
        return Tallies(cells, kinds, replicas)
