"""Phase functions as Mitsuba plugins."""

from __future__ import annotations

import mitsuba as mi

from spisim.atmosphere import Blend, HenyeyGreenstein, Isotropic, Phase, Tabulated
from spisim.transport.jit import Object


def phase_plugin(phase: Phase) -> Object:
    """A phase function as a Mitsuba plugin; needs an active variant."""
    match phase:
        case Isotropic():
            return mi.load_dict({"type": "isotropic"})
        case HenyeyGreenstein(g=g):
            return mi.load_dict({"type": "hg", "g": g})
        case Tabulated():
            return _table(phase)
        case Blend(parts=((_, only),)):
            return phase_plugin(only)
        case Blend(parts=((weight, first), *others)):
            rest = Blend(tuple((fraction / (1 - weight), other) for fraction, other in others))
            return mi.load_dict(
                {
                    "type": "blendphase",
                    "weight": 1 - weight,
                    "first": phase_plugin(first),
                    "second": phase_plugin(rest),
                }
            )
    raise TypeError(f"not a phase function: {phase!r}")


def _table(phase: Tabulated) -> Object:
    """Set the table by parameter: as text, which the plugin takes, it has megabytes."""
    plugin = mi.load_dict({"type": "tabphase", "values": "1, 1"})
    parameters = mi.traverse(plugin)
    parameters["values"] = mi.Float(phase.values)
    parameters.update()
    return plugin
