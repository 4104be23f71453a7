"""What hangs in the air between instrument and scene: fog by visibility, at 1550 nm."""

from spisim.atmosphere.fog import CLEAR, FOGS, Atmosphere, explicit, extinction_at_550nm, fog

__all__ = ["CLEAR", "FOGS", "Atmosphere", "explicit", "extinction_at_550nm", "fog"]
