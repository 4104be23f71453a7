"""A scene before simulation: its distances, and a drawing with the instrument."""

from .picture import Look, write_look
from .survey import Spot, Survey, survey

__all__ = ["Look", "Spot", "Survey", "survey", "write_look"]
