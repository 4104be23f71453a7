"""Recordings of existing rigs and plain arrays -> capture."""

from .arrays import capture_from_readings, plan_from_matrix
from .files import load_array

__all__ = ["capture_from_readings", "load_array", "plan_from_matrix"]
