"""Materials: reflectance and scattering of surfaces by wavelength, with their sources."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError, naming, nearest
from spisim.base.config import Fraction, Name, Section, parse_model, read_text
from spisim.base.config.files import read_picture
from spisim.scene.bsdf import DIFFUSE, Bsdf, Clear, Retroreflector, make_bsdf
from spisim.scene.description import MaterialDescription, Spectrum
from spisim.scene.wetness import wet_reflectance

Picture: TypeAlias = NDArray[np.float32]

#: Default wavelength of materials.
WAVELENGTH_NM = 1550.0
#: Maximum distance from a tabulated wavelength; water's absorption bands are wider.
MAX_DISTANCE_NM = 50.0


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
    name: str,
    described: MaterialDescription,
    folder: Path,
    wavelength_nm: float = WAVELENGTH_NM,
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
        _reflectance(described, bsdf.fresnel_reflectance, wavelength_nm),
        described.source,
        bsdf,
        None if texture is None else read_picture(folder / texture),
        read_picture(folder / opacity) if isinstance(opacity, str) else opacity,
    )


def at_wavelength(field: str, values: Spectrum, wavelength_nm: float) -> float:
    """Value at a wavelength: linear between tabulated ones, constant for `MAX_DISTANCE_NM` beyond."""
    if not isinstance(values, Mapping):
        return values
    available = sorted(values)
    if min(abs(other - wavelength_nm) for other in available) > MAX_DISTANCE_NM:
        listed = ", ".join(f"{other:g}" for other in available)
        raise InputError(
            f"{field} is known at {listed} nm and {MAX_DISTANCE_NM:g} nm around, "
            f"asked for at {wavelength_nm:g} nm"
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
