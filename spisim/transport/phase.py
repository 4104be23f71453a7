"""Phase functions as Mitsuba plugins."""

from typing import Any

from spisim.atmosphere import Blend, HenyeyGreenstein, Isotropic, Phase, Tabulated


def phase_dict(phase: Phase) -> dict[str, Any]:
    """Mitsuba description of a phase function."""
    match phase:
        case Isotropic():
            return {"type": "isotropic"}
        case HenyeyGreenstein(g=g):
            return {"type": "hg", "g": g}
        case Tabulated(values=values):
            return {"type": "tabphase", "values": ",".join(map(repr, values.tolist()))}
        case Blend(parts=((_, only),)):
            return phase_dict(only)
        case Blend(parts=((weight, first), *others)):
            rest = Blend(tuple((share / (1 - weight), other) for share, other in others))
            return {
                "type": "blendphase",
                "weight": 1 - weight,
                "first": phase_dict(first),
                "second": phase_dict(rest),
            }
    raise TypeError(f"not a phase function: {phase!r}")
