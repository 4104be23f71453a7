"""Materials as Mitsuba describes them, at one wavelength."""

import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.scene import Material
from spisim.scene.bsdf import (
    Bsdf,
    Clear,
    Conductor,
    Dielectric,
    Diffuse,
    Mirror,
    Plastic,
    Principled,
    Retroreflector,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinPane,
)
from spisim.transport.coat import body_scale, plastic
from spisim.transport.compensated import compensated_metal, compensated_plastic
from spisim.transport.retroreflector import retroreflector

Quantity = float | NDArray[np.float32]  # one value everywhere, or a picture


def bsdf_dict(material: Material) -> dict[str, Any]:
    """Mitsuba description of a material, pictures included; needs an active variant.

    Opaque surfaces look alike from both sides, because meshes at the scale of a drone are often
    sheets without thickness, or inside out.
    """
    described = _model(material.bsdf, material)
    if not isinstance(material.bsdf, Clear):
        described = {"type": "twosided", "bsdf": described}
    if material.opacity is not None:
        described = {"type": "mask", "opacity": spectrum(material.opacity), "bsdf": described}
    return described


def is_null_transmitting(material: Material) -> bool:
    """Whether light may pass the surface without a change of direction."""
    return material.opacity is not None or isinstance(material.bsdf, ThinPane)


def _model(bsdf: Bsdf, material: Material) -> dict[str, Any]:
    match bsdf:
        case Diffuse():
            return {"type": "diffuse", "reflectance": spectrum(_reflectance(material))}
        case Plastic(ior):
            return _plastic(material, ior, 0.0)
        case RoughPlastic(roughness, ior, distribution):
            return _plastic(material, ior, roughness, distribution)
        case Mirror():
            return {"type": "conductor", **_metal(_reflectance(material))}
        case Conductor(eta, k):
            return {"type": "conductor", **_metal(_texture(material), complex(eta, k))}
        case RoughConductor(roughness, eta, k, distribution):
            index, texture = complex(eta, k), _texture(material)
            metal = _rough("conductor", roughness, distribution) | _metal(texture, index)
            return compensated_metal(metal, index, roughness, distribution, spectrum(texture))
        case Principled():
            return _principled(bsdf, material)
        case Retroreflector():
            return _retroreflector(bsdf, material)
        case Dielectric() | RoughDielectric() | ThinPane():
            return _clear(bsdf)


def _clear(bsdf: Clear) -> dict[str, Any]:
    indices = {"int_ior": float(bsdf.ior), "ext_ior": 1.0}
    match bsdf:
        case Dielectric():
            return {"type": "dielectric", **indices}
        case RoughDielectric():
            return _rough("dielectric", bsdf.roughness, bsdf.distribution) | indices
        case ThinPane():
            return {"type": "thindielectric", **indices}


def _principled(bsdf: Principled, material: Material) -> dict[str, Any]:
    root = math.sqrt(0.08 * bsdf.specular)  # of the coat's reflectance at normal incidence
    reflectance = _reflectance(material)
    metal = _rough("conductor", bsdf.roughness) | _metal(reflectance)
    return {
        "type": "blendbsdf",
        "weight": spectrum(bsdf.metallic),
        "plastic": _plastic(material, (1 + root) / (1 - root), bsdf.roughness),
        "metal": compensated_metal(metal, None, bsdf.roughness, "ggx", spectrum(reflectance)),
    }


def _retroreflector(bsdf: Retroreflector, material: Material) -> dict[str, Any]:
    """Lobe and body, each drawn in proportion to its brightness."""
    total = bsdf.returned + material.reflectance
    white = spectrum(total * _texture(material))
    return {
        "type": "blendbsdf",
        "weight": spectrum(bsdf.returned / total if total > 0 else 0.0),
        "body": {"type": "diffuse", "reflectance": white},
        "lobe": retroreflector(bsdf.roughness, white),
    }


def _plastic(
    material: Material, ior: float, roughness: float, distribution: str = "ggx"
) -> dict[str, Any]:
    reflectance, model = _reflectance(material), (ior, roughness, distribution)
    described = plastic(*model, spectrum(reflectance * body_scale(*model)))
    if roughness > 0:
        described = compensated_plastic(described, *model, spectrum(reflectance))
    return described


def _metal(reflectance: Quantity, index: complex | None = None) -> dict[str, Any]:
    """`reflectance` times that of a refractive index; without one, the same at every angle."""
    described: dict[str, Any] = {"specular_reflectance": spectrum(reflectance)}
    if index is None:
        return described | {"material": "none"}
    return described | {"eta": spectrum(index.real), "k": spectrum(index.imag)}


def _rough(plugin: str, roughness: float, distribution: str = "ggx") -> dict[str, Any]:
    return {"type": f"rough{plugin}", "distribution": distribution, "alpha": float(roughness)}


def _texture(material: Material) -> Quantity:
    return 1.0 if material.texture is None else material.texture


def _reflectance(material: Material) -> Quantity:
    return material.reflectance * _texture(material)


def spectrum(value: Quantity) -> dict[str, Any]:
    """A value or a picture as Mitsuba describes it."""
    if isinstance(value, np.ndarray):
        picture = np.ascontiguousarray(value[..., None], dtype=np.float32)
        return {"type": "bitmap", "bitmap": mi.Bitmap(picture), "raw": True}
    return {"type": "rgb", "value": [float(value)] * 3}
