"""Materials: reflectance and scattering of surfaces by wavelength, with their sources."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError, naming, nearest
from spisim.atmosphere import refractive_index
from spisim.base.config import Fraction, Name, Section, parse_model, read_text
from spisim.base.config.files import read_picture
from spisim.scene.bsdf import DIFFUSE, Bsdf, Clear, Retroreflector, fresnel_reflectance, make_bsdf
from spisim.scene.description import MaterialDescription, Spectrum

Picture: TypeAlias = NDArray[np.float32]

#: Default wavelength of materials.
WAVELENGTH_NM = 1550.0
#: Maximum distance from a tabulated wavelength; water's absorption bands are wider.
MAX_DISTANCE_NM = 50.0
#: Water that light crosses between air and grains, one way. With it, the wet-to-dry ratio of 100
#: soils at 1550 nm is that measured by Minasny et al. (2011), Geoderma 167, 118.
FILM_MM = 0.1
#: Refractive index of the grains: quartz, clay, cellulose.
GRAIN_IOR = 1.5


@dataclass(frozen=True, eq=False)
class Material:
    """A surface at one wavelength.

    Pictures (h, w) hold values from 0 to 1, with the first row at the top of the mesh's texture
    coordinates (v = 1), and repeat beyond them. `texture` multiplies the reflectance; `opacity` is
    the opaque fraction of the surface, and light passes through the rest unchanged.

    Raises
    ------
    InputError
        For a texture on a transparent surface, which reflects by refraction alone, and for a
        surface that returns more light than it receives.
    """

    name: str
    reflectance: float  # of the diffuse body, else at normal incidence
    source: str
    bsdf: Bsdf = DIFFUSE
    texture: Picture | None = None
    opacity: float | Picture | None = None

    def __post_init__(self) -> None:
        if self.texture is not None and isinstance(self.bsdf, Clear):
            raise InputError("texture does not go with a clear surface; use opacity")
        if isinstance(self.bsdf, Retroreflector) and self.bsdf.returned + self.reflectance > 1:
            raise InputError(
                f"returned and reflectance should add up to 1 at most; found {self.bsdf.returned} "
                f"and {self.reflectance}"
            )

    @property
    def needs_texture_coordinates(self) -> bool:
        """Whether the mesh needs texture coordinates for a picture."""
        return self.texture is not None or isinstance(self.opacity, np.ndarray)


class ShippedMaterial(MaterialDescription):
    """A row of the shipped table; `typical` is the expected range of reflectances at 1550 nm."""

    typical: tuple[Fraction, Fraction] | None = None


class ShippedMaterials(Section):
    """The shipped table: dry surfaces, and which of them exist soaked."""

    dry: dict[Name, ShippedMaterial]
    wet: dict[Name, Name]

    @property
    def names(self) -> list[str]:
        """Names of all materials."""
        return [*self.dry, *self.wet]


@cache
def shipped_materials() -> ShippedMaterials:
    """The shipped table with values at all its wavelengths."""
    path = Path(__file__).with_name("materials.yaml")
    return parse_model(read_text(path), ShippedMaterials, path)


def material_table(wavelength_nm: float = WAVELENGTH_NM) -> dict[str, Material]:
    """The shipped materials by name.

    Raises
    ------
    InputError
        For a wavelength more than `MAX_DISTANCE_NM` from those of the table.
    """
    return {name: _shipped(name, float(wavelength_nm)) for name in shipped_materials().names}


def find_material(
    name: str, extra: Mapping[str, Material] | None = None, wavelength_nm: float = WAVELENGTH_NM
) -> Material:
    """Material of this name, from `extra` or else the shipped table.

    Raises
    ------
    InputError
        Names the nearest material, if there is none; or as `material_table`.
    """
    extra = extra or {}
    if name in extra:
        return extra[name]
    names = shipped_materials().names
    if name not in names:
        raise InputError(f"unknown material {name!r}: {nearest(name, sorted({*names, *extra}))}")
    return _shipped(name, float(wavelength_nm))


def make_material(
    name: str, described: MaterialDescription, folder: Path, wavelength_nm: float = WAVELENGTH_NM
) -> Material:
    """Material of a description, with pictures from `folder`."""
    parameters = {
        field: values if isinstance(values, str) else at_wavelength(field, values, wavelength_nm)
        for field, values in described.parameters().items()
    }
    bsdf = make_bsdf(described.bsdf, parameters)
    texture, opacity = described.texture, described.opacity
    return Material(
        name,
        _reflectance(described, fresnel_reflectance(bsdf), wavelength_nm),
        described.source,
        bsdf,
        None if texture is None else read_picture(folder / texture),
        read_picture(folder / opacity) if isinstance(opacity, str) else opacity,
    )


def at_wavelength(field: str, values: Spectrum, wavelength_nm: float) -> float:
    """Value at a wavelength: linear between tabulated ones, constant `MAX_DISTANCE_NM` beyond."""
    if not isinstance(values, Mapping):
        return values
    available = sorted(values)
    if min(abs(other - wavelength_nm) for other in available) > MAX_DISTANCE_NM:
        listed = ", ".join(f"{other:g}" for other in available)
        raise InputError(
            f"{field} is tabulated at {listed} nm, each within {MAX_DISTANCE_NM:g} nm; found "
            f"{wavelength_nm:g} nm"
        )
    return float(np.interp(wavelength_nm, available, [values[other] for other in available]))


@cache
def _shipped(name: str, wavelength_nm: float) -> Material:
    table = shipped_materials()
    with naming(f"material {name!r}"):
        dry_name = table.wet.get(name, name)
        dry = make_material(name, table.dry[dry_name], Path(), wavelength_nm)
        if name not in table.wet:
            return dry
        return Material(
            name,
            wet_reflectance(dry.reflectance, wavelength_nm),
            f"{dry_name}, soaked (Lekner & Dorf 1988, Bablet et al. 2018): {dry.source}",
        )


def _reflectance(
    described: MaterialDescription, fresnel: float | None, wavelength_nm: float
) -> float:
    given = described.reflectance
    if fresnel is None:
        if given is None:
            raise InputError("reflectance is missing")
        return at_wavelength("reflectance", given, wavelength_nm)
    if given is not None:
        raise InputError(
            f"reflectance does not go with bsdf {described.bsdf}: it follows from refraction, "
            f"{fresnel:.3g} at normal incidence"
        )
    return fresnel


def wet_reflectance(dry: float, wavelength_nm: float) -> float:
    """Diffuse reflectance of a soaked surface from that of the dry one, both 0 to 1.

    The water's surface reflects part of the light back to the grains, and grains absorb more in
    water than in air: Lekner & Dorf (1988), Applied Optics 27, 1278, after Ångström (1925). Water
    absorbs on each pass: the film of Bablet et al. (2018), Remote Sensing of Environment 217, 1.
    The glint of the water, 2 %, counts as diffuse, so surfaces about that dark come out brighter
    than dry. InputError for a wavelength outside 400 to 1700 nm.
    """
    index = refractive_index("water", wavelength_nm)
    water = index.real
    entering = mean_fresnel_transmittance(GRAIN_IOR / water) / mean_fresnel_transmittance(GRAIN_IOR)
    body = 1 - (1 - dry) * (1 - dry + dry * entering)
    absorption_per_mm = 4 * math.pi * -index.imag / (wavelength_nm * 1e-6)
    body *= math.exp(-2 * absorption_per_mm * FILM_MM)
    glint = ((water - 1) / (water + 1)) ** 2
    leaving = mean_fresnel_transmittance(water) / water**2
    return glint + (1 - glint) * leaving * body / (1 - (1 - leaving) * body)


def mean_fresnel_transmittance(ior: float) -> float:
    """Diffuse transmittance of a smooth surface into a relative index above 1.

    Walsh (1926), in the form of Duntley (1942), J. Opt. Soc. Am. 32, 61.
    """
    n, n2, n4 = ior, ior**2, ior**4
    reflected = (
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + n2 * (n2 - 1) ** 2 / (n2 + 1) ** 3 * math.log((n - 1) / (n + 1))
        - 2 * n**3 * (n2 + 2 * n - 1) / ((n2 + 1) * (n4 - 1))
        + 8 * n4 * (n4 + 1) / ((n2 + 1) * (n4 - 1) ** 2) * math.log(n)
    )
    return 1 - reflected
