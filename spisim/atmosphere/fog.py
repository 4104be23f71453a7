"""Fog, haze and smoke, from visibility or water content.

Visibility fixes the extinction at 550 nm, and the droplet sizes fix its ratio at the instrument's
wavelength. Visibility scales the number of droplets, not their sizes, so albedo and phase function
do not depend on it.

With droplets as large as those of water fog, 1550 nm reaches no further than the eye: extinction is
3 to 14 % higher. It is lower only for particles smaller than the wavelength, in haze and smoke.
"""

import math

import numpy as np

from reconstruction.base.errors import InputError
from spisim.atmosphere.droplets import FOGS, WATER_G_PER_CM3, Particles, named_particles
from spisim.atmosphere.lookup import look_up, look_up_classes
from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.mie_phase import phase_function
from spisim.atmosphere.spectrum import SpectrumSizes
from spisim.atmosphere.uncertainty import Uncertainty, propagated
from spisim.atmosphere.visibility import VISUAL_NM, extinction_at_550nm, visibility

#: Maximum water of natural fog is about 0.5 g/m³; rain clouds have 1 and more.
MAX_WATER_G_PER_M3 = 1.0
#: Fogs of small droplets, with little water for their extinction.
LIGHTER_FOGS = ("heavy-radiation", "moderate-radiation")
#: With a coagulation coefficient of 1e-9 cm³/s this number halves within three minutes (W. C.
#: Hinds, Aerosol Technology, 1999, chapter 12).
MAX_PARTICLES_PER_CM3 = 1e7
#: Tolerance between visibility and water content if both are given.
AGREEMENT = 0.05


def fog(
    visibility_m: float | None,
    kind: str | Particles,
    definition: str = "koschmieder",
    *,
    wavelength_nm: float = 1550.0,
    phase: str = "mie",
) -> Atmosphere:
    """Fog, haze or smoke with a visibility.

    Parameters
    ----------
    visibility_m : float, optional
        Visibility at 550 nm, metres; None for that of a measured spectrum's own numbers.
    kind : str or Particles
        Name in `FOGS` or `SMOKES`, or custom particles.
    definition : str
        Of visibility: "koschmieder" or "mor".
    wavelength_nm : float
        400 to 1700 nm.
    phase : str
        "mie", "double-hg" or "hg".

    Raises
    ------
    InputError
        For unknown names, a visibility that is not positive and finite, none for particles of
        unknown number, and other wavelengths.
    """
    particles = _particles(kind)
    by_number = visibility_m is None
    if visibility_m is None:
        visibility_m = _own_visibility(particles, definition)
    extinction_550 = extinction_at_550nm(visibility_m, definition)
    number_per_m3 = extinction_550 / look_up(particles, VISUAL_NM).extinction_m2
    name = kind if isinstance(kind, str) else "droplets" if particles.are_water else "particles"
    optics = look_up(particles, wavelength_nm)
    water = _water_g_per_m3(particles, extinction_550)
    return Atmosphere(
        number_per_m3 * optics.extinction_m2,
        optics.albedo,
        phase_function(optics, phase, name),
        name,
        visibility_m,
        definition,
        water,
        _warnings(name, visibility_m, extinction_550, water, 1e-6 * number_per_m3),
        uncertainty=_uncertainty(particles, wavelength_nm, by_number=by_number),
    )


def visibility_of_water(
    water_g_per_m3: float, kind: str | Particles, definition: str = "koschmieder"
) -> float:
    """Visibility in metres of fog with a liquid water content.

    Raises
    ------
    InputError
        As `fog`, for particles other than water, and unless the content is positive and finite.
    """
    particles = _particles(kind)
    if not particles.are_water:
        raise InputError(f"liquid_water_g_per_m3 does not go with {kind}, which is not water")
    if not (math.isfinite(water_g_per_m3) and water_g_per_m3 > 0):
        raise InputError(
            f"liquid_water_g_per_m3 should be greater than 0 and finite; found {water_g_per_m3}"
        )
    number_per_m3 = water_g_per_m3 / (1e6 * WATER_G_PER_CM3 * particles.volume_m3)
    return visibility(number_per_m3 * look_up(particles, VISUAL_NM).extinction_m2, definition)


def agreed_visibility(
    visibility_m: float | None,
    water_g_per_m3: float | None,
    kind: str | Particles,
    definition: str = "koschmieder",
) -> float:
    """Visibility in metres, from visibility or water content or both.

    Raises
    ------
    InputError
        If neither is given, or both contradict each other.
    """
    if water_g_per_m3 is None:
        if visibility_m is None:
            raise InputError("needs visibility_m or liquid_water_g_per_m3")
        return visibility_m
    of_water = visibility_of_water(water_g_per_m3, kind, definition)
    if visibility_m is None:
        return of_water
    if not abs(visibility_m / of_water - 1) <= AGREEMENT:
        raise InputError(
            f"visibility_m {visibility_m:g} and liquid_water_g_per_m3 {water_g_per_m3:g} "
            "contradict each other: in droplets of this size, that water gives a visibility of "
            f"{of_water:.3g} m; give one of them"
        )
    return visibility_m


def _own_visibility(particles: Particles, definition: str) -> float:
    sizes = particles.sizes
    number = sizes.number_per_cm3 if isinstance(sizes, SpectrumSizes) else None
    if number is None:
        raise InputError(
            "needs visibility_m or liquid_water_g_per_m3: sizes alone, or counts without "
            "sampled_cm3, tell no number of droplets"
        )
    return visibility(1e6 * number * look_up(particles, VISUAL_NM).extinction_m2, definition)


def _uncertainty(
    particles: Particles, wavelength_nm: float, *, by_number: bool
) -> Uncertainty | None:
    """What the counts of a measured spectrum leave unsure."""
    sizes = particles.sizes
    if not isinstance(sizes, SpectrumSizes) or (sigma := sizes.sigma) is None:
        return None
    here, visual = (look_up_classes(particles, nm) for nm in (wavelength_nm, VISUAL_NM))
    return propagated(
        np.array(sizes.numbers),
        sigma,
        here["extinction_m2"],
        here["scattering_m2"],
        here["forward_m2"],
        here["per_steradian_m2"],
        None if by_number else visual["extinction_m2"],
    )


def _particles(kind: str | Particles) -> Particles:
    return kind if isinstance(kind, Particles) else named_particles(kind)


def _water_g_per_m3(particles: Particles, extinction_550_per_m: float) -> float:
    """Liquid water of the particles with this extinction at 550 nm."""
    if not particles.are_water:
        return 0.0
    number_per_m3 = extinction_550_per_m / look_up(particles, VISUAL_NM).extinction_m2
    return 1e6 * WATER_G_PER_CM3 * number_per_m3 * particles.volume_m3


def _warnings(
    name: str,
    visibility_m: float,
    extinction_550_per_m: float,
    water_g_per_m3: float,
    number_per_cm3: float,
) -> tuple[str, ...]:
    if water_g_per_m3 > MAX_WATER_G_PER_M3:
        others = {kind: _water_g_per_m3(FOGS[kind], extinction_550_per_m) for kind in LIGHTER_FOGS}
        natural = [
            f"{kind} holds {water:.2g}"
            for kind, water in others.items()
            if water <= MAX_WATER_G_PER_M3
        ]
        instead = f"; at the same visibility {' and '.join(natural)}" if natural else ""
        return (
            f"{name} with {visibility_m:g} m of visibility holds {water_g_per_m3:.3g} g/m³ of "
            f"water; natural fog holds up to {MAX_WATER_G_PER_M3:g}{instead}",
        )
    if number_per_cm3 > MAX_PARTICLES_PER_CM3:
        return (
            f"{name} with {visibility_m:g} m of visibility holds {number_per_cm3:.2g} particles "
            f"per cm³; more than {MAX_PARTICLES_PER_CM3:.0e} coagulate within minutes",
        )
    return ()
