"""Fog in scene files, and any other medium by its coefficients."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from spisim.atmosphere.droplets import GammaSizes, LogNormalSizes, Particles
from spisim.atmosphere.fog import agreed_visibility, fog
from spisim.atmosphere.medium import MAX_EXTINCTION_PER_M, Atmosphere, explicit
from spisim.atmosphere.mie_phase import PHASES, PhaseName
from spisim.atmosphere.phase import Blend, Phase, henyey_greenstein
from spisim.atmosphere.table import tabulate
from spisim.atmosphere.weather import Weather
from spisim.base.config import Fraction, Name, Number, Positive, Section
from spisim.base.config.files import read_columns


class PhaseDescription(Section):
    """A phase function: `g` of Henyey-Greenstein, a `table` file, or a `blend` of several.

    Beside a table, `g` is what its mean cosine should be, and `unit` whether its values are
    absolute.
    """

    g: Annotated[Number, Field(gt=-1, lt=1)] | None = None
    """Mean cosine of the Henyey-Greenstein function; beside a table, what its mean cosine should
    be.
    """
    table: Name | None = None
    """File of two columns: cosine or angle in degrees, and value."""
    unit: Literal["relative", "1/sr"] = "relative"
    """Whether the table's values are absolute."""
    blend: Annotated[tuple[BlendPart, ...], Field(min_length=1)] | None = None
    """Several phase functions, weighted."""

    @model_validator(mode="after")
    def _one_way(self) -> PhaseDescription:
        given = self.model_fields_set - {"weight"}
        allowed = {"table", "g", "unit"} if "table" in given else {"g"}
        if given not in ({"blend"}, {"g"}) and not ("table" in given and given <= allowed):
            raise PydanticCustomError("phase", "needs one of g, table (with unit and g), or blend")
        return self

    def made(self, folder: Path) -> Phase:
        """The phase function; its table is looked for in `folder`."""
        if self.blend is not None:
            return Blend(tuple((part.weight, part.made(folder)) for part in self.blend))
        if self.table is not None:
            return tabulate(
                read_columns(folder / self.table),
                per_steradian=self.unit == "1/sr",
                declared_g=self.g,
                name=self.table,
            )
        assert self.g is not None  # one of the three there is
        return henyey_greenstein(self.g)


class BlendPart(PhaseDescription):
    """A phase function's share of a blend; the weights sum to 1."""

    weight: Positive
    """Share of this one; they sum to 1."""


class DropletDescription(Section):
    """Sizes of droplets or particles: a modified gamma distribution or a log-normal one.

    n(r) ∝ r^alpha exp(-b r^gamma) with its peak at `mode_radius_um`; or half of the particles
    below `median_diameter_um` and 68 % within a factor `sigma_g`. They are of water unless `n` and
    `k` give another refractive index n - ik.
    """

    alpha: Number | None = None
    """Exponent of the radius in the modified gamma distribution."""
    gamma: Number | None = None
    """Exponent of the radius in its exponential."""
    mode_radius_um: Number | None = None
    """Radius at its peak."""
    median_diameter_um: Number | None = None
    """Diameter that half of the particles are below, of the log-normal one."""
    sigma_g: Number | None = None
    """Its geometric standard deviation; above 1."""
    n: Number | None = None
    """Real part of the particles' refractive index; water's without."""
    k: Number = 0.0
    """Its imaginary part; goes with `n`."""

    @model_validator(mode="after")
    def _one_way(self) -> DropletDescription:
        ways = {"alpha", "gamma", "mode_radius_um"}, {"median_diameter_um", "sigma_g"}
        if self.model_fields_set - {"n", "k"} not in ways:
            message = "needs alpha, gamma and mode_radius_um, or median_diameter_um and sigma_g"
            raise PydanticCustomError("droplets", message)
        if "k" in self.model_fields_set and self.n is None:
            raise PydanticCustomError("droplets", "k needs n")
        return self

    def made(self) -> Particles:
        """The particles."""
        sizes: GammaSizes | LogNormalSizes
        if self.alpha is not None:
            assert self.gamma is not None  # all three there are
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
    """Fog by visibility or water, or a medium by its coefficients, at any wavelength the same.

    Its droplets are of a `kind` or have sizes of their own (`droplets`). The `phase` of fog by
    visibility or water is the name of a form, that of a medium by coefficients a phase function.
    """

    visibility_m: Positive | None = None
    """Meteorological range at 550 nm, by `definition`."""
    liquid_water_g_per_m3: Positive | None = None
    """Liquid water content; alone, or beside the visibility that it must fit."""
    kind: str = "moderate-radiation"
    """Name of its droplets' sizes; for fog by visibility or water."""
    droplets: DropletDescription | None = None
    """Sizes of its own in place of a `kind`."""
    definition: str = "koschmieder"
    """What visibility means: a contrast of 2 % (koschmieder) or of 5 % (mor)."""
    extinction_per_m: Annotated[Number, Field(ge=0, le=MAX_EXTINCTION_PER_M)] | None = None
    """Extinction, for a medium by its coefficients."""
    albedo: Fraction = 1.0
    """Share of the light met that is scattered; goes with `extinction_per_m`."""
    g: Annotated[Number, Field(gt=-1, lt=1)] = 0.0
    """Mean cosine of the scattering angle (Henyey-Greenstein); goes with `extinction_per_m`."""
    phase: AnyPhase | None = None
    """Form of the phase function by name, or, with `extinction_per_m`, the function itself."""

    def made(self, folder: Path, wavelength_nm: float) -> Atmosphere:
        """The medium; one by its coefficients is the same at every wavelength."""
        if self.extinction_per_m is not None:
            phase: Phase = henyey_greenstein(self.g)
            if isinstance(self.phase, PhaseDescription):
                phase = self.phase.made(folder)
            return explicit(self.extinction_per_m, self.albedo, phase)
        kind = self.kind if self.droplets is None else self.droplets.made()
        visibility_m = agreed_visibility(
            self.visibility_m, self.liquid_water_g_per_m3, kind, self.definition
        )
        form = self.phase if isinstance(self.phase, str) else "mie"
        return fog(visibility_m, kind, self.definition, wavelength_nm=wavelength_nm, phase=form)

    @model_validator(mode="after")
    def _one_way(self) -> Fog:
        given = self.model_fields_set
        amounts = [f for f in ("visibility_m", "liquid_water_g_per_m3") if f in given]
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
