"""MAVLink, the protocol of PX4 and ArduPilot: poses from an autopilot, obstacles to it."""

from .connections import is_mavlink, mavlink_outlet
from .source import PoseSigmas, PoseSource

__all__ = ["PoseSigmas", "PoseSource", "is_mavlink", "mavlink_outlet"]
