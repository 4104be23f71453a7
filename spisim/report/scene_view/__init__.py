"""A scene before anything is simulated: its distances, and a picture of it with the instrument."""

from .picture import Look, write_look
from .survey import Spot, Survey, survey

__all__ = ["Look", "Spot", "Survey", "survey", "write_look"]
