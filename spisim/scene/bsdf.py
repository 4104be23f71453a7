"""Surface scattering models as data, which the transport turns into its renderer's BSDFs.

`roughness` is the width α of the microfacet slope distribution in every model: GGX, or Beckmann's
(Gaussian) for rough plastics, metals and dielectrics (Walter et al. 2007). `ior` is the refractive
index relative to air; `eta` and `k` are the real and imaginary part of a metal's.
The material states the reflectance at normal incidence unless it follows from refraction.
"""

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from types import MappingProxyType
from typing import Any, Literal, TypeAlias, get_args

from reconstruction.base.errors import InputError, nearest

#: A narrower microfacet lobe acts as a mirror and exceeds single precision.
MIN_ROUGHNESS = 0.01
MAX_IOR = 5.0
#: Maximum index of a clear coat; no denser ones exist.
MAX_COAT_IOR = 3.0
MIN_SPECULAR = 0.01
#: Distributions of microfacet slopes.
Distribution = Literal["ggx", "beckmann"]
DISTRIBUTIONS: tuple[Distribution, ...] = get_args(Distribution)
#: Beads and prisms are no better, and single precision loses a narrower lobe.
MIN_RETRO_ROUGHNESS = 0.001


@dataclass(frozen=True)
class Diffuse:
    """Lambertian reflection."""


DIFFUSE = Diffuse()


@dataclass(frozen=True)
class Plastic:
    """A diffuse body under a smooth clear coat: gloss paint, glazed tiles."""

    ior: float = 1.5

    def __post_init__(self) -> None:
        _check_ior(self.ior, MAX_COAT_IOR)


@dataclass(frozen=True)
class RoughPlastic:
    """A diffuse body under a rough clear coat: most paints and plastics."""

    roughness: float
    ior: float = 1.5
    distribution: Distribution = "ggx"

    def __post_init__(self) -> None:
        _check_roughness(self.roughness)
        _check_distribution(self.distribution)
        _check_ior(self.ior, MAX_COAT_IOR)


@dataclass(frozen=True)
class Mirror:
    """Specular reflection with the material's reflectance at every angle."""


@dataclass(frozen=True)
class Conductor:
    """A smooth metal."""

    eta: float
    k: float

    def __post_init__(self) -> None:
        _check_metal(self.eta, self.k)


@dataclass(frozen=True)
class RoughConductor:
    """A rough metal: blasted, brushed or weathered."""

    roughness: float
    eta: float
    k: float
    distribution: Distribution = "ggx"

    def __post_init__(self) -> None:
        _check_roughness(self.roughness)
        _check_distribution(self.distribution)
        _check_metal(self.eta, self.k)


@dataclass(frozen=True)
class Dielectric:
    """The smooth surface of a transparent solid, a closed mesh."""

    ior: float = 1.5

    def __post_init__(self) -> None:
        _check_ior(self.ior)


@dataclass(frozen=True)
class RoughDielectric:
    """The rough surface of a transparent solid, a closed mesh: frosted glass."""

    roughness: float
    ior: float = 1.5
    distribution: Distribution = "ggx"

    def __post_init__(self) -> None:
        _check_roughness(self.roughness)
        _check_distribution(self.distribution)
        _check_ior(self.ior)


@dataclass(frozen=True)
class ThinPane:
    """A transparent pane without thickness: light passes straight on or is mirrored."""

    ior: float = 1.5

    def __post_init__(self) -> None:
        _check_ior(self.ior)


@dataclass(frozen=True)
class Principled:
    """A rough plastic blended by `metallic` with a rough metal of the material's reflectance.

    `specular` is the plastic's gloss after Burley (2012): 12.5 times the reflectance of its coat at
    normal incidence; 0.5 is a refractive index of 1.5.
    """

    roughness: float = 0.25
    metallic: float = 0.0
    specular: float = 0.5

    def __post_init__(self) -> None:
        _check_roughness(self.roughness)
        _check_range("metallic", self.metallic, 0, 1)
        _check_range("specular", self.specular, MIN_SPECULAR, 1)


@dataclass(frozen=True)
class Retroreflector:
    """A diffuse body that also returns light to its source: reflective tape, cat's eyes.

    The lobe is that of microfacets that face the incoming light, whatever the surface normal
    (compare the back vector of Belcour et al. 2014, JOSA A 31, 2561), so it is symmetric about the
    incoming direction. `returned` is its fraction of the light at normal incidence. The coefficient
    of retroreflection falls with the entrance angle β as cosᵏβ, k = `ENTRANCE_FALL`. At an
    observation angle δ (small α and δ, in sr⁻¹, which are cd/(lx m²)) it is

        R_A = returned · cosᵏβ / (4 π α² (1 + δ² / (2 α)²)²)

    The default roughness is that of class 2 tape by EN ISO 20471 (2013); with `returned` 0.15 it
    meets the minimum coefficients from 0.2 to 1.5° within a quarter. Not modelled: prisms return
    six beams instead of one lobe, weaker in some directions.
    """

    returned: float
    roughness: float = 0.0054

    def __post_init__(self) -> None:
        _check_range("returned", self.returned, 0, 1)
        _check_range("roughness", self.roughness, MIN_RETRO_ROUGHNESS, 1)


#: Fitted to EN ISO 20471 (2013), class 2, at an observation angle of 0.2°: 330, 290, 180 and 65
#: cd/(lx m²) at entrance angles of 5, 20, 30 and 40°.
ENTRANCE_FALL = 5


Clear: TypeAlias = Dielectric | RoughDielectric | ThinPane
Bsdf: TypeAlias = (
    Diffuse
    | Plastic
    | RoughPlastic
    | Mirror
    | Conductor
    | RoughConductor
    | Principled
    | Retroreflector
    | Dielectric
    | RoughDielectric
    | ThinPane
)

#: The models by their names in scene files.
BSDFS: Mapping[str, type[Any]] = MappingProxyType(
    {
        "diffuse": Diffuse,
        "plastic": Plastic,
        "rough-plastic": RoughPlastic,
        "mirror": Mirror,
        "conductor": Conductor,
        "rough-conductor": RoughConductor,
        "dielectric": Dielectric,
        "rough-dielectric": RoughDielectric,
        "thin-pane": ThinPane,
        "principled": Principled,
        "retroreflector": Retroreflector,
    }
)


def make_bsdf(name: str, parameters: Mapping[str, float | str]) -> Bsdf:
    """Model of a name in `BSDFS`; InputError for an unknown name or unfit parameters."""
    if name not in BSDFS:
        raise InputError(f"unknown bsdf {name!r}: {nearest(name, BSDFS)}")
    available = {field.name: field.default is MISSING for field in fields(BSDFS[name])}
    if stray := sorted(parameters.keys() - available):
        allowed = ", ".join(available) or "none"
        raise InputError(f"{stray[0]} does not go with bsdf {name}; its parameters: {allowed}")
    missing = [
        field for field, required in available.items() if required and field not in parameters
    ]
    if missing:
        raise InputError(f"bsdf {name} needs {missing[0]}")
    bsdf: Bsdf = BSDFS[name](**parameters)
    return bsdf


def fresnel_reflectance(bsdf: Bsdf) -> float | None:
    """Reflectance at normal incidence, of a smooth patch from outside, or None if not refraction's.

    That of a pane includes all reflections between its faces.
    """
    match bsdf:
        case Conductor() | RoughConductor():
            return fresnel(complex(bsdf.eta, bsdf.k))
        case Dielectric() | RoughDielectric():
            return fresnel(bsdf.ior)
        case ThinPane():
            once = fresnel(bsdf.ior)
            return 2 * once / (1 + once)
    return None


def fresnel(index: complex) -> float:
    """Reflectance at normal incidence of a half-space of complex refractive index."""
    return abs((index - 1) / (index + 1)) ** 2


def _check_roughness(roughness: float) -> None:
    _check_range("roughness", roughness, MIN_ROUGHNESS, 1)


def _check_distribution(distribution: str) -> None:
    if distribution not in DISTRIBUTIONS:
        raise InputError(
            f"unknown distribution {distribution!r}: {nearest(distribution, DISTRIBUTIONS)}"
        )


def _check_ior(ior: float, largest: float = MAX_IOR) -> None:
    if not 1 < ior <= largest:
        raise InputError(
            f"ior should be greater than 1 (air) and not above {largest:g}; found {ior}"
        )


def _check_metal(eta: float, k: float) -> None:
    if not (0 < eta < math.inf and 0 < k < math.inf):
        raise InputError(f"eta and k should be greater than 0 and finite; found {eta} and {k}")


def _check_range(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InputError(f"{name} should lie between {low:g} and {high:g}; found {value}")
