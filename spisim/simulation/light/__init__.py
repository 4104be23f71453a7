"""Light of a recording, traced as far as the detectors' noise asks, or a surrogate of it."""

from spisim.simulation.light.path_bins import NEAR_PATH_M
from spisim.simulation.light.sequence import Light, LightSequence, trace
from spisim.simulation.light.solve import Transport, solve
from spisim.simulation.light.steered import Steered, solve_spots, steered_light
from spisim.simulation.light.surrogate import surrogate, surrogate_light, surrogate_spots

__all__ = [
    "NEAR_PATH_M",
    "Light",
    "LightSequence",
    "Steered",
    "Transport",
    "solve",
    "solve_spots",
    "steered_light",
    "surrogate",
    "surrogate_light",
    "surrogate_spots",
    "trace",
]
