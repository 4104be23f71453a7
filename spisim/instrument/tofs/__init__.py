"""Methods of ranging, one module each, named like their `method`; other packages add theirs."""

from typing import Annotated, Any, TypeAlias

from reconstruction.base.registry import Registry
from spisim.base.config import one_of
from spisim.instrument.tof import Tof

TOFS: Registry[Any] = Registry(  # classes of a protocol are no type[Tof]
    "method of time of flight", package=__name__, attribute="TOF", group="spisim.tofs"
)

#: Any method, as a field of a file.
AnyTof: TypeAlias = Annotated[Tof, one_of(TOFS, "method")]
