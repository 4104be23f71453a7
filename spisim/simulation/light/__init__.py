"""Light of a recording, traced as far as the detectors' noise asks, or a surrogate of it."""

from spisim.simulation.light.sequence import Light, LightSequence, trace
from spisim.simulation.light.solve import Transport, solve
from spisim.simulation.light.surrogate import surrogate, surrogate_light

__all__ = ["Light", "LightSequence", "Transport", "solve", "surrogate", "surrogate_light", "trace"]
