"""A simulated drone that replaces a rig: streams its frames and flies as commanded."""

from spisim_serving.drone import Drone, Follower, Gust, Pilot
from spisim_serving.line import Line
from spisim_serving.record import FlightRecord
from spisim_serving.server import Server, Tally

__all__ = ["Drone", "FlightRecord", "Follower", "Gust", "Line", "Pilot", "Server", "Tally"]
