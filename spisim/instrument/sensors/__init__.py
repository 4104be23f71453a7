"""Sensors, one module each, named like their `type`; other packages add theirs."""

from typing import Annotated, TypeAlias

from reconstruction.base.registry import Registry
from spisim.base.config import one_of
from spisim.instrument.sensor import Sensor

SENSORS: Registry[type[Sensor]] = Registry(
    "sensor", package=__name__, attribute="SENSOR", group="spisim.sensors"
)

#: Any sensor, as a field of a file.
AnySensor: TypeAlias = Annotated[Sensor, one_of(SENSORS, "type")]
