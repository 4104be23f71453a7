"""Where frames, results and the state of a stream go."""

from .detached import Detached
from .named import sink_to
from .sink import Sink

__all__ = ["Detached", "Sink", "sink_to"]
