"""Ranges and obstacles as MAVLink's messages for an autopilot."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ..links import Outlet
from ..mavlink.codec import codec, dialect
from ..mavlink.obstacles import sector_fields, spot_fields
from ..results import Outcome, State
from .channel import Channel
from .sink import Sink


class MavlinkSink(Sink):
    """Sends DISTANCE_SENSOR of each spot and OBSTACLE_DISTANCE of the map, and a heartbeat."""

    waiting = 2
    skips = True
    fleeting = True

    def __init__(self, outlet: Outlet, clock: Callable[[], float] = time.monotonic) -> None:
        self._channel = Channel(outlet, clock)
        self._clock = clock
        self._begun_s = clock()
        self._codec: Any = None

    @contextmanager
    def ready(self) -> Iterator[None]:
        dialect()
        self._channel.check()
        yield

    def result(self, outcome: Outcome) -> None:
        result, setup = outcome.result, outcome.stream.setup
        time_us = round(1e6 * (self._clock() - self._begun_s))
        common = dialect()
        for fields in spot_fields(result, setup, time_us // 1000):
            self._send(common.MAVLink_distance_sensor_message(**fields))
        if (sectors := sector_fields(result, setup, time_us)) is not None:
            self._send(common.MAVLink_obstacle_distance_message(**sectors))

    def state(self, state: State) -> None:
        common = dialect()
        self._send(
            common.MAVLink_heartbeat_message(
                type=common.MAV_TYPE_ONBOARD_CONTROLLER,
                autopilot=common.MAV_AUTOPILOT_INVALID,
                base_mode=0,
                custom_mode=0,
                system_status=common.MAV_STATE_ACTIVE,
                mavlink_version=3,
            )
        )

    def close(self) -> None:
        self._channel.close()

    def abandon(self) -> None:
        self._channel.close()

    def _send(self, message: Any) -> None:
        self._codec = self._codec or codec()
        content = message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        self._channel.send(content)
