"""A simulated drone that replaces a rig: streams its frames and flies as commanded."""

from spisim.serving.drone import Drone, Follower, Gust, Pilot
from spisim.serving.line import Line
from spisim.serving.record import FlightRecord
from spisim.serving.server import Server, Tally

__all__ = ["Drone", "FlightRecord", "Follower", "Gust", "Line", "Pilot", "Server", "Tally"]
