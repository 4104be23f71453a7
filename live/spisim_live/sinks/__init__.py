"""Sinks of frames, results and states of a stream."""

from .named import sink_to
from .sink import Detached, Sink

__all__ = ["Detached", "Sink", "sink_to"]
