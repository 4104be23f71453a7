"""Methods that choose where mirrors point next, one module each; other packages add theirs."""

from collections.abc import Callable
from typing import TypeAlias

from reconstruction.base.arrays import Floats
from reconstruction.base.registry import Registry

Aim: TypeAlias = Callable[[Callable[[Floats], Floats], Floats, tuple[float, float], float], Floats]
"""From the doubt of the last depth map (see `spisim.instrument.steering`), directions (mirrors,
spots of each, 2) at rest in degrees, half ranges [across, up] and the minimum angle between spots
of different mirrors to offsets (mirrors, 2)."""

AIMS: Registry[Aim] = Registry(
    "method of aiming", package=__name__, attribute="AIM", group="spisim.aims"
)
