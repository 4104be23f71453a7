"""Fog in scene files, and media by their coefficients."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from spisim.atmosphere.droplets import GammaSizes, LogNormalSizes, Particles, Sizes
from spisim.atmosphere.fog import agreed_visibility, fog
from spisim.atmosphere.medium import MAX_EXTINCTION_PER_M, Atmosphere, explicit
from spisim.atmosphere.mie_phase import PHASES, PhaseName
from spisim.atmosphere.phase import Blend, Phase, henyey_greenstein
from spisim.atmosphere.spectrum import read_droplets
from spisim.atmosphere.table import tabulate
from spisim.atmosphere.weather import Weather
from spisim.base.config import Fraction, Name, Number, Positive, Section
from spisim.base.config.files import read_columns


class PhaseDescription(Section):
    """A phase function: Henyey-Greenstein's by `g`, a `table` file, or a `blend` of several."""

    g: Annotated[Number, Field(gt=-1, lt=1)] | None = None
    """Mean cosine of the Henyey-Greenstein function; beside a table, that expected of it."""
    table: Name | None = None
    """File of two columns: cosine or angle in degrees, and value."""
    unit: Literal["relative", "1/sr"] = "relative"
    """Whether the table's values are absolute."""
    blend: Annotated[tuple[BlendPart, ...], Field(min_length=1)] | None = None
    """Weighted phase functions."""

    @model_validator(mode="after")
    def _one_way(self) -> PhaseDescription:
        given = self.model_fields_set - {"weight"}
        allowed = {"table", "g", "unit"} if "table" in given else {"g"}
        if given not in ({"blend"}, {"g"}) and not ("table" in given and given <= allowed):
            raise PydanticCustomError("phase", "needs one of g, table (with unit and g), or blend")
        return self

    def made(self, folder: Path) -> Phase:
        """The phase function, with its table from `folder`."""
        if self.blend is not None:
            return Blend(tuple((part.weight, part.made(folder)) for part in self.blend))
        if self.table is not None:
            return tabulate(
                read_columns(folder / self.table),
                per_steradian=self.unit == "1/sr",
                declared_g=self.g,
                name=self.table,
            )
        assert self.g is not None  # one of the three is given
        return henyey_greenstein(self.g)


class BlendPart(PhaseDescription):
    """A weighted phase function of a blend."""

    weight: Positive
    """Weight of this one; they sum to 1."""


class DropletDescription(Section):
    """Sizes of droplets or particles, by a distribution, or as measured.

    n(r) ∝ r^alpha exp(-b r^gamma) with its peak at `mode_radius_um`, or 68 % of the particles
    within a factor `sigma_g` of `median_diameter_um`, or a file of a spectrum.
    """

    alpha: Number | None = None
    """Exponent of the radius in the modified gamma distribution."""
    gamma: Number | None = None
    """Exponent of the radius in its exponential function."""
    mode_radius_um: Number | None = None
    """Radius at its peak."""
    median_diameter_um: Number | None = None
    """Median diameter of the log-normal distribution."""
    sigma_g: Number | None = None
    """Its geometric standard deviation; above 1."""
    spectrum: Name | None = None
    """File of two columns, diameters and numbers; its first line names them with their units."""
    sampled_cm3: Positive | None = None
    """Air in which the droplets of the spectrum were counted."""
    n: Number | None = None
    """Real part of the particles' refractive index; by default water's."""
    k: Number = 0.0
    """Its imaginary part; goes with `n`."""

    @model_validator(mode="after")
    def _one_way(self) -> DropletDescription:
        ways = {"alpha", "gamma", "mode_radius_um"}, {"median_diameter_um", "sigma_g"}
        given = self.model_fields_set - {"n", "k"}
        if given not in ways and given - {"sampled_cm3"} != {"spectrum"}:
            message = (
                "needs alpha, gamma and mode_radius_um, or median_diameter_um and sigma_g, or "
                "spectrum (with sampled_cm3)"
            )
            raise PydanticCustomError("droplets", message)
        if "k" in self.model_fields_set and self.n is None:
            raise PydanticCustomError("droplets", "k needs n")
        return self

    def made(self, folder: Path) -> Particles:
        """The particles described; files are relative to `folder`."""
        sizes: Sizes
        if self.spectrum is not None:
            sizes = read_droplets(folder / self.spectrum, self.sampled_cm3)
        elif self.alpha is not None:
            assert self.gamma is not None  # all three are given
            assert self.mode_radius_um is not None
            sizes = GammaSizes(self.alpha, self.gamma, self.mode_radius_um)
        else:
            assert self.median_diameter_um is not None  # or these two
            assert self.sigma_g is not None
            sizes = LogNormalSizes(self.median_diameter_um, self.sigma_g)
        return Particles(sizes, None if self.n is None else complex(self.n, -self.k))


AnyPhase = Annotated[
    Annotated[PhaseName, Tag("by name")] | Annotated[PhaseDescription, Tag("by numbers")],
    Discriminator(lambda data: "by name" if isinstance(data, str) else "by numbers"),
]


class Fog(Weather):
    """Fog by visibility or water, or a medium by coefficients that hold at any wavelength.

    Its droplets are of a `kind`, or `droplets` gives their sizes; a measured spectrum of them gives
    their number as well. `phase` names a form for fog by droplets; for a medium by coefficients it
    is a phase function.
    """

    visibility_m: Positive | None = None
    """Visibility at 550 nm, by `definition`."""
    liquid_water_g_per_m3: Positive | None = None
    """Liquid water content; alone, or beside a visibility that agrees."""
    kind: str = "moderate-radiation"
    """Named droplet sizes, for fog by visibility or water."""
    droplets: DropletDescription | None = None
    """Custom sizes instead of a `kind`."""
    definition: str = "koschmieder"
    """Definition of visibility: contrast of 2 % (koschmieder) or 5 % (mor)."""
    extinction_per_m: Annotated[Number, Field(ge=0, le=MAX_EXTINCTION_PER_M)] | None = None
    """Extinction of a medium by coefficients."""
    albedo: Fraction = 1.0
    """Scattered fraction of the extinction; goes with `extinction_per_m`."""
    g: Annotated[Number, Field(gt=-1, lt=1)] = 0.0
    """Mean cosine of the scattering angle (Henyey-Greenstein); goes with `extinction_per_m`."""
    phase: AnyPhase | None = None
    """Named form of the phase function, or, with `extinction_per_m`, the function itself."""

    def made(self, folder: Path, wavelength_nm: float) -> Atmosphere:
        """The medium; one by coefficients is the same at every wavelength."""
        if self.extinction_per_m is not None:
            phase: Phase = henyey_greenstein(self.g)
            if isinstance(self.phase, PhaseDescription):
                phase = self.phase.made(folder)
            return explicit(self.extinction_per_m, self.albedo, phase)
        kind = self.kind if self.droplets is None else self.droplets.made(folder)
        visibility_m = None
        if {"visibility_m", "liquid_water_g_per_m3"} & self.model_fields_set:
            visibility_m = agreed_visibility(
                self.visibility_m, self.liquid_water_g_per_m3, kind, self.definition
            )
        form = self.phase if isinstance(self.phase, str) else "mie"
        return fog(visibility_m, kind, self.definition, wavelength_nm=wavelength_nm, phase=form)

    @model_validator(mode="after")
    def _one_way(self) -> Fog:
        given = self.model_fields_set
        amounts: list[str] = [f for f in ("visibility_m", "liquid_water_g_per_m3") if f in given]
        if not amounts and self.droplets is not None and self.droplets.spectrum is not None:
            amounts = ["droplets"]
        if bool(amounts) == ("extinction_per_m" in given):
            raise PydanticCustomError(
                "fog", "needs either visibility_m or extinction_per_m, or liquid_water_g_per_m3"
            )
        for pair in ({"g", "phase"}, {"kind", "droplets"}):
            if pair <= given:
                one, other = sorted(pair, key=list(type(self).model_fields).index)
                raise PydanticCustomError(
                    "fog", "needs {one} or {other}, not both", {"one": one, "other": other}
                )
        way = amounts[0] if amounts else "extinction_per_m"
        stray = sorted(given & ({"albedo", "g"} if amounts else {"kind", "droplets", "definition"}))
        if "phase" in given and isinstance(self.phase, str) != bool(amounts):
            stray.append("phase")
        if stray:
            hint = f": it is one of {', '.join(PHASES)}" if amounts and stray == ["phase"] else ""
            raise PydanticCustomError(
                "fog",
                "{field} does not go with {way}{hint}",
                {"field": stray[0], "way": way, "hint": hint},
            )
        return self


WEATHER = Fog
