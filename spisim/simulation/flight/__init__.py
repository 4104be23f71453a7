"""A flight, frame by frame: light at key poses, carried along the drone's motion."""

from spisim.simulation.flight.camera import Camera, Shot, provenance, solver
from spisim.simulation.flight.keys import Keys, PathKeys, PoseKeys
from spisim.simulation.flight.motion import Motion

__all__ = ["Camera", "Keys", "Motion", "PathKeys", "PoseKeys", "Shot", "provenance", "solver"]
