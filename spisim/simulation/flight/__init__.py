"""A flight, frame by frame: light at key poses, carried along the drone's motion."""

from spisim.simulation.flight.camera import Camera, Shot, provenance, solver
from spisim.simulation.flight.flying import record_flight
from spisim.simulation.flight.keys import Keys, PathKeys, PoseKeys
from spisim.simulation.flight.motion import Motion
from spisim.simulation.flight.pose_error import EXACT, PoseError, StatedPoses
from spisim.simulation.flight.recording import FlightRecorder, flown, true_poses

__all__ = [
    "EXACT",
    "Camera",
    "FlightRecorder",
    "Keys",
    "Motion",
    "PathKeys",
    "PoseError",
    "PoseKeys",
    "Shot",
    "StatedPoses",
    "flown",
    "provenance",
    "record_flight",
    "solver",
    "true_poses",
]
