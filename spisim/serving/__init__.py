"""A simulated drone that replaces a rig: streams its frames and flies as commanded."""

from spisim.serving.camera import Camera, provenance, solver
from spisim.serving.drone import Drone, Follower, Gust, Pilot
from spisim.serving.keys import Keys, PathKeys, PoseKeys
from spisim.serving.line import Line
from spisim.serving.motion import Motion
from spisim.serving.record import FlightRecord
from spisim.serving.server import Server, Tally

__all__ = [
    "Camera",
    "Drone",
    "FlightRecord",
    "Follower",
    "Gust",
    "Keys",
    "Line",
    "Motion",
    "PathKeys",
    "Pilot",
    "PoseKeys",
    "Server",
    "Tally",
    "provenance",
    "solver",
]
