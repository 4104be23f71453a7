"""Where frames, results and the state of a stream go."""

from .named import sink_to
from .sink import Detached, Sink

__all__ = ["Detached", "Sink", "sink_to"]
