"""Mitsuba's bsdfs as materials of a scene file, using red values.

https://mitsuba.readthedocs.io/en/stable/src/generated/plugins_bsdfs.html
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError
from spisim.scene.bsdf import MIN_ROUGHNESS, make_bsdf
from spisim.scene.materials import WAVELENGTH_NM, at_wavelength
from spisim_formats.library.metals import WAVELENGTHS_NM, metal
from spisim_formats.library.opacity import Opacity, cut, uniform
from spisim_formats.library.source_material import SourceMaterial
from spisim_formats.library.textures import Texture, linear_red
from spisim_formats.mitsuba.elements import Node

#: Mitsuba's names of dielectrics, and their refractive indices.
INDICES = MappingProxyType({
    "vacuum": 1.0, "helium": 1.000036, "hydrogen": 1.000132, "air": 1.000277,
    "carbon dioxide": 1.00045, "water": 1.333, "acetone": 1.36, "ethanol": 1.361,
    "carbon tetrachloride": 1.461, "glycerol": 1.4729, "benzene": 1.501, "silicone oil": 1.52045,
    "bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458, "pyrex": 1.47,
    "acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544,
    "amber": 1.55, "pet": 1.575, "diamond": 2.419,
})  # fmt: skip
GLASS, COAT, AIR = "bk7", "polypropylene", "air"
WRAPPERS = ("twosided", "mask", "bumpmap", "normalmap")
#: Unsupported lobes of `principled`.
LOBES = ("anisotropic", "clearcoat", "sheen", "spec_trans", "flatness", "spec_tint")
#: Minimum parts of a metal's index; a real part of zero is a perfect mirror.
MIN_INDEX = 1e-6
#: Maximum nesting of bsdfs.
MAX_DEPTH = 8
#: Pixels of a checkerboard.
SIDE = 1024

#: Properties that may be textures, and their fields of a material.
PICTURED = {
    "reflectance": "reflectance",
    "diffuse_reflectance": "reflectance",
    "base_color": "reflectance",
    "opacity": "opacity",
}

Fields: TypeAlias = dict[str, Any]
#: Finds the texture that a node names.
Pictures: TypeAlias = Callable[[Node], Texture | None]


def source_surface(node: Node, flips: bool, pictures: Pictures) -> SourceMaterial | None:
    """Return the material of a bsdf; None if nothing here is like it.

    `flips` tells that the shape's texture coordinates have v down, and `pictures` finds textures of
    nodes.
    """
    try:
        fields, odd = _fields(node)
        _check(fields)
        result = {
            name: _picture(texture, flips, pictures)
            for name, texture in _textures(node).items()
            if name in fields
        }
    except InputError:
        return None
    return SourceMaterial(fields, result, odd)


def opacity(node: Node, flips: bool, pictures: Pictures) -> Opacity | None:
    """Return the opacity of a bsdf by the masks around it, arguments as of `source_surface`."""
    for _ in range(MAX_DEPTH):
        if node.type == "mask":
            value = node.properties.get("opacity", 0.5)
            if isinstance(value, Node) and value.type in ("checkerboard", "bitmap"):
                return cut(_picture(value, flips, pictures))
            return uniform(_number(node, "opacity", 0.5))
        inner = next((each for each in node.children if each.kind == "bsdf"), None)
        if node.type not in WRAPPERS or inner is None:
            return None
        node = inner
    return None


def _check(fields: Fields) -> None:
    """Raise InputError unless the fields are physically possible."""
    names = ("bsdf", "source", "reflectance", "opacity")
    parameters = {
        name: at_wavelength(name, value, WAVELENGTH_NM) if isinstance(value, dict) else value
        for name, value in fields.items()
        if name not in names
    }
    make_bsdf(fields["bsdf"], parameters)
    if not all(0 <= fields.get(name, 0) <= 1 for name in names[2:]):
        raise InputError("reflects or holds back more than there is")


def _fields(node: Node, depth: int = 0) -> tuple[Fields, tuple[str, ...]]:
    """Return a row's fields, and the properties of the bsdf that are lost."""
    if node.type in WRAPPERS:
        inner = next((each for each in node.children if each.kind == "bsdf"), None)
        if inner is None or depth > MAX_DEPTH:
            raise InputError(f"{node.what}: holds no other, or itself")
        fields, odd = _fields(inner, depth + 1)
        if node.type == "mask":
            fields["opacity"] = _number(node, "opacity", 0.5)
        elif node.type != "twosided":
            odd = (*odd, f"its {node.type} is left out")
        return fields, odd
    if node.type not in MAKERS:
        raise InputError(node.type)
    return MAKERS[node.type](node)


def _diffuse(node: Node) -> tuple[Fields, tuple[str, ...]]:
    return {"bsdf": "diffuse", "reflectance": _number(node, "reflectance", 0.5)}, ()


def _plastic(node: Node) -> tuple[Fields, tuple[str, ...]]:
    fields: Fields = {
        "bsdf": "plastic",
        "reflectance": _number(node, "diffuse_reflectance", 0.5),
        "ior": _ior(node, COAT),
    }
    odd = (
        ("its body takes colour on inside (nonlinear) there",)
        if node.value("nonlinear", False)
        else ()
    )
    if node.type == "plastic":
        return fields, odd
    fields |= {"bsdf": "rough-plastic", **_roughness(node, 0.1)}
    return fields, (*odd, "light between its coat and body, lost there, is not here")


def _clear(node: Node) -> tuple[Fields, tuple[str, ...]]:
    names = {"dielectric": "dielectric", "thindielectric": "thin-pane",
             "roughdielectric": "rough-dielectric"}  # fmt: skip
    fields: Fields = {"bsdf": names[node.type], "ior": _ior(node, GLASS)}
    if node.type == "roughdielectric":
        fields |= _roughness(node, 0.1)
    return fields, ()


def _metal(node: Node) -> tuple[Fields, tuple[str, ...]]:
    """Return a metal by its numbers, by its name as at 1550 nm, or a mirror."""
    name, fraction = node.value("material", "none"), _number(node, "specular_reflectance", 1.0)
    numbers = "eta" in node.properties or "k" in node.properties
    if name == "none" and not numbers and node.type == "conductor":
        return {"bsdf": "mirror", "reflectance": fraction}, ()
    odd = () if fraction == 1 else (f"its specular_reflectance {fraction:.3g} is left out",)
    fields: Fields = {"bsdf": "conductor"}
    if name == "none":
        fields |= {
            key: max(_number(node, key, default), MIN_INDEX)
            for key, default in (("eta", 0.0), ("k", 1.0))
        }
    elif (given := metal(name)) is not None:
        for key, values in (("eta", given.eta), ("k", given.k)):
            fields[key] = dict(zip(WAVELENGTHS_NM, values, strict=True))
        fields["source"] = given.source
        odd = (*odd, f"{name} by its name, at {WAVELENGTH_NM:g} nm {given.eta[-1]:.3g} + "
               f"{given.k[-1]:.3g}i, not as in visible light")  # fmt: skip
    else:
        raise InputError(f"a metal {name!r:.80}")
    if node.type == "conductor":
        return fields, odd
    return fields | {"bsdf": "rough-conductor", **_roughness(node, 0.1)}, odd


def _principled(node: Node) -> tuple[Fields, tuple[str, ...]]:
    roughness = _number(node, "roughness", 0.5)
    fields = {
        "bsdf": "principled",
        "reflectance": _number(node, "base_color", 0.5),
        "roughness": float(np.clip(roughness**2, MIN_ROUGHNESS, 1)),
        "metallic": _number(node, "metallic", 0.0),
        "specular": _number(node, "specular", 0.5),
    }
    odd = [f"its {name} is left out" for name in LOBES if name in node.properties]
    return fields, ("it is made of other lobes there", *odd)


MAKERS: Mapping[str, Callable[[Node], tuple[Fields, tuple[str, ...]]]] = {
    "diffuse": _diffuse,
    "plastic": _plastic,
    "roughplastic": _plastic,
    "dielectric": _clear,
    "thindielectric": _clear,
    "roughdielectric": _clear,
    "conductor": _metal,
    "roughconductor": _metal,
    "principled": _principled,
}


def _roughness(node: Node, default: float) -> Fields:
    if "alpha_u" in node.properties or "alpha_v" in node.properties:
        raise InputError("brushed")
    alpha = _number(node, "alpha", default)
    kind = node.value("distribution", "beckmann")
    return {"roughness": float(np.clip(alpha, MIN_ROUGHNESS, 1)), "distribution": kind}


def _ior(node: Node, inner: str) -> float:
    inside, outside = (
        _index(node.properties.get(name, default))
        for name, default in (("int_ior", inner), ("ext_ior", AIR))
    )
    return inside / outside


def _index(value: Any) -> float:
    if isinstance(value, str):
        if value.lower() not in INDICES:
            raise InputError(value)
        return INDICES[value.lower()]
    if not isinstance(value, int | float):
        raise InputError("an index that varies")
    return float(value)


def _number(node: Node, name: str, default: float) -> float:
    """Return red, or a number; nothing for a texture, which is handled separately."""
    value: Any = node.properties.get(name, default)
    if isinstance(value, Node) and value.type in ("checkerboard", "bitmap"):
        return 0.0
    if isinstance(value, Node):
        value = value.properties.get("value")
    if isinstance(value, bool | int | float):
        return float(value)
    if np.shape(value) == (3,):
        return float(value[0])
    raise InputError(f"{node.what}: {name}")


def _textures(node: Node) -> dict[str, Node]:
    """Return textures by field. Raises InputError if one is of any other property."""
    result: dict[str, Node] = {}
    for each in (node, *(child for child in node.children if child.kind == "bsdf")):
        for name, value in each.properties.items():
            if not isinstance(value, Node) or value.type not in ("checkerboard", "bitmap"):
                continue
            if name not in PICTURED and each.type in ("bumpmap", "normalmap"):
                continue
            if name not in PICTURED:
                raise InputError(f"{each.what}: {name}")
            result[PICTURED[name]] = value
    return result


def _picture(node: Node, flips: bool, pictures: Pictures) -> NDArray[np.float32]:
    """Return a texture (h, w) over the unit square of its coordinates, the top row first."""
    to_uv = node.value("to_uv", np.eye(4))
    if node.type == "bitmap":
        texture = pictures(node)
        if texture is None or not np.allclose(to_uv, np.eye(4)):
            raise InputError(f"{node.what}: is missing, or laid on otherwise")
        red = linear_red(texture)
        return red if flips else np.ascontiguousarray(red[::-1])
    across = (np.arange(SIDE) + 0.5) / SIDE
    u, v = np.meshgrid(across, across if flips else across[::-1])
    x, y = np.einsum("ij,jhw->ihw", to_uv[:2, :2], np.stack([u, v])) + to_uv[:2, 3, None, None]
    same = (x - np.floor(x) > 0.5) == (y - np.floor(y) > 0.5)
    first, second = _number(node, "color0", 0.4), _number(node, "color1", 0.2)
    return np.where(same, first, second).astype(np.float32)
