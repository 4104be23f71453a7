"""Ranges of the spots from time-of-flight readings: methods and what they share."""

from .brightness import Brightness, brightness_at
from .consistency import range_consistency
from .method import RangingMethod, RangingSolver
from .methods import RANGING_METHODS, measure_ranges, ranging_method, reads, usual_rangings
from .ranges import (
    MIN_SIGNAL,
    RANGED,
    Alternative,
    FogOptics,
    Paths,
    Ranges,
    Status,
    range_from_path,
    ranges_from_paths,
)
from .reach import blind_below_m
from .unwrap import path_from_phases, unambiguous_path_m
from .visibility import Visibility, pooled
from .weather import Weather, with_weather

__all__ = [
    "MIN_SIGNAL",
    "RANGED",
    "RANGING_METHODS",
    "Alternative",
    "Brightness",
    "FogOptics",
    "Paths",
    "Ranges",
    "RangingMethod",
    "RangingSolver",
    "Status",
    "Visibility",
    "Weather",
    "blind_below_m",
    "brightness_at",
    "measure_ranges",
    "path_from_phases",
    "pooled",
    "range_consistency",
    "range_from_path",
    "ranges_from_paths",
    "ranging_method",
    "reads",
    "unambiguous_path_m",
    "usual_rangings",
    "with_weather",
]
