"""Media as a scene file describes them."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from functools import singledispatch
from pathlib import Path
from typing import Any

from spisim import atmosphere
from spisim.atmosphere import (
    Atmosphere,
    Blend,
    GammaSizes,
    LogNormalSizes,
    Particles,
    Phase,
    precipitation,
)
from spisim.atmosphere.precipitation import Precipitation
from spisim.scene.description import (
    DropletDescription,
    FallingDescription,
    FogDescription,
    PhaseDescription,
    RainDescription,
    SnowDescription,
)
from spisim.scene.files import read_columns
from spisim.scene.warning import SceneWarning


@singledispatch
def make_medium(described: Any, folder: Path, wavelength_nm: float) -> Atmosphere:
    """The medium that a section describes, at a wavelength; files are relative to `folder`.

    What is given by its coefficients has the same at every wavelength.

    Raises InputError for what the section's fields cannot tell alone: unknown kinds, values outside
    the range of a model, contradictions, and phase functions that are none.
    """
    raise TypeError(f"not a medium: {described!r}")


@make_medium.register
def _(described: FogDescription, folder: Path, wavelength_nm: float) -> Atmosphere:
    if described.extinction_per_m is not None:
        phase = _phase(described.phase, folder) if described.phase else None
        return atmosphere.explicit(
            described.extinction_per_m,
            described.albedo,
            phase or atmosphere.henyey_greenstein(described.g),
        )
    kind = described.kind if described.droplets is None else _particles(described.droplets)
    visibility_m = atmosphere.agreed_visibility(
        described.visibility_m, described.liquid_water_g_per_m3, kind, described.definition
    )
    form = described.phase if isinstance(described.phase, str) else "mie"
    return atmosphere.fog(
        visibility_m, kind, described.definition, wavelength_nm=wavelength_nm, phase=form
    )


def make_precipitation(described: FallingDescription, wavelength_nm: float) -> Precipitation:
    """The single drops or flakes that a section describes, at a wavelength.

    Raises InputError for rates out of range, and rain of a wavelength that it is not tabulated at.
    """
    rate, wind = described.rate_mm_per_h, described.wind_m_s
    if isinstance(described, RainDescription):
        kind = described.kind
        return precipitation.rain(rate, kind, wavelength_nm=wavelength_nm, wind_m_s=wind)
    assert isinstance(described, SnowDescription)
    names = described.model_fields_set & {"albedo", "g", "flake_density_kg_m3", "fall_speed_m_s"}
    assumed = {name: getattr(described, name) for name in names}
    return precipitation.snow(rate, wavelength_nm=wavelength_nm, wind_m_s=wind, **assumed)


@make_medium.register
def _(described: RainDescription, folder: Path, wavelength_nm: float) -> Atmosphere:
    return atmosphere.rain(
        described.rate_mm_per_h,
        described.kind,
        wavelength_nm=wavelength_nm,
        diffraction=described.diffraction,
    )


@make_medium.register
def _(described: SnowDescription, folder: Path, wavelength_nm: float) -> Atmosphere:
    return atmosphere.snow(
        described.rate_mm_per_h,
        described.kind,
        wavelength_nm=wavelength_nm,
        albedo=described.albedo,
        g=described.g,
    )


def warn_of_doubtful_media(media: Iterable[Atmosphere]) -> None:
    """SceneWarning for everything about them that nature does not have."""
    for medium in media:
        for doubt in medium.doubts:
            warnings.warn(doubt, SceneWarning, stacklevel=2)


def _particles(described: DropletDescription) -> Particles:
    sizes: GammaSizes | LogNormalSizes
    if described.alpha is not None:
        assert described.gamma is not None  # the description demands all three
        assert described.mode_radius_um is not None
        sizes = GammaSizes(described.alpha, described.gamma, described.mode_radius_um)
    else:
        assert described.median_diameter_um is not None  # or these two
        assert described.sigma_g is not None
        sizes = LogNormalSizes(described.median_diameter_um, described.sigma_g)
    return Particles(sizes, None if described.n is None else complex(described.n, -described.k))


def _phase(described: PhaseDescription | str, folder: Path) -> Phase:
    assert isinstance(described, PhaseDescription)  # which goes with an extinction alone
    if described.blend is not None:
        return Blend(tuple((part.weight, _phase(part, folder)) for part in described.blend))
    if described.table is not None:
        return atmosphere.tabulate(
            read_columns(folder / described.table),
            per_steradian=described.unit == "1/sr",
            declared_g=described.g,
            name=described.table,
        )
    assert described.g is not None  # the description demands one of the three
    return atmosphere.henyey_greenstein(described.g)
