"""OpenUSD's preview surfaces: names, colours, textures, metalness and roughness.

https://openusd.org/release/spec_usdpreviewsurface.html
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from spisim_formats.library.content import Content, Surface
from spisim_formats.library.files import Folders, quoted
from spisim_formats.library.metallic import Metallic
from spisim_formats.library.opacity import Opacity, cut, uniform
from spisim_formats.library.textures import Texture, read_channels
from spisim_formats.usd.package import read_from_package

KIND, PICTURE, COORDINATES = "UsdPreviewSurface", "UsdUVTexture", "UsdPrimvarReader_float2"
#: Primvar of the meshes' texture coordinates.
PRIMVAR = "st"
CHANNELS = {"rgb": 0, "r": 0, "g": 1, "b": 2, "a": 3}
#: Further properties of a surface, and their defaults.
LEFT_OUT = {"normal": "bumps are", "displacement": "bumps are", "emissiveColor": "own light is",
            "clearcoat": "clear coat is"}  # fmt: skip
#: Inputs, their names here, and their defaults, using red of colours.
INPUTS = {"diffuseColor": ("base", 0.18), "metallic": ("metal", 0.0),
          "roughness": ("roughness", 0.5), "opacity": ("opacity", 1.0)}  # fmt: skip


def read_surface(material: Any, content: Content, folders: Folders) -> Surface:
    """Return the surface of a material's prim, or of None; note missing textures."""
    from pxr import UsdShade

    if material is None:
        return Surface()
    name = material.GetName()
    shader = UsdShade.Material(material).ComputeSurfaceSource()[0]
    if not shader or shader.GetShaderId() != KIND:
        return Surface(name)
    lacking: list[str] = []
    numbers: dict[str, float] = {}
    pictures: dict[str, tuple[Texture, int]] = {}
    for key, (what, default) in INPUTS.items():
        source = _source(shader, key)
        if _is_picture(source):
            result = _picture(source, content, folders)
            if result is None:
                lacking.append(key)
                numbers[what] = default
                continue
            pictures[what], numbers[what] = result[:2], result[2]
        else:
            numbers[what] = _red(source, default)
    if "opacity" in lacking:
        content.warn(f"material {quoted(name)}: its opacity is no picture that is read: opaque")
    texture = None
    if "base" in pictures:
        texture = replace(pictures["base"][0], factor=numbers["base"])
    diffuse = _source(shader, "diffuseColor")
    color = None
    if not _is_picture(diffuse) and diffuse is not None and (value := diffuse.Get()) is not None:
        color = (float(value[0]), float(value[1]), float(value[2]))
    threshold = _red(_source(shader, "opacityThreshold"), 0.0)
    made_opacity = partial(
        _opacity, numbers["opacity"], pictures.pop("opacity", None), threshold or None
    )
    opacity = cache(partial(content.attempt, f"material {quoted(name)}: opacity", made_opacity))
    surface = Surface(name, color, texture=texture, opacity=opacity)
    if lacking or _red(_source(shader, "useSpecularWorkflow"), 0) != 0:
        return surface
    odd = [f"its {what} left out" for key, what in LEFT_OUT.items() if _is_there(shader, key)]
    made = Metallic(
        numbers["base"],
        numbers["metal"],
        numbers["roughness"],
        ior=_red(_source(shader, "ior"), 1.5),
        opacity=opacity(),
        pictures=pictures,
        odd=tuple(dict.fromkeys(odd)),
    )
    return replace(surface, source=cache(made.source_material))


def _opacity(
    factor: float, picture: tuple[Texture, int] | None, cutoff: float | None
) -> Opacity | None:
    if picture is None:
        return uniform(factor, cutoff)
    (fraction,) = read_channels(*picture)
    return cut(factor * fraction, cutoff, fits=picture[0].fits)


def _source(shader: Any, name: str) -> Any:
    """Return the attribute that drives an input; None if the input is missing."""
    given = shader.GetInput(name)
    result = given.GetValueProducingAttributes() if given else []
    return result[0] if result else None


def _is_picture(source: Any) -> bool:
    from pxr import UsdShade

    output = UsdShade.AttributeType.Output
    return source is not None and UsdShade.Utils.GetType(source.GetName()) == output


def _red(source: Any, default: float) -> float:
    """Return red of a value; the default if it has none, or is a texture."""
    value = None if source is None or _is_picture(source) else source.Get()
    return default if value is None else float(np.ravel(value)[0])


def _is_there(shader: Any, name: str) -> bool:
    """Return whether an input is a texture, or a number other than 0 or straight up."""
    source = _source(shader, name)
    if source is None or _is_picture(source):
        return source is not None
    value = source.Get()
    return value is not None and bool(np.any(value)) and name != "normal"


def _picture(source: Any, content: Content, folders: Folders) -> tuple[Texture, int, float] | None:
    """Return texture and channel of an output, and its scale; None if unsupported."""
    from pxr import UsdShade

    shader = UsdShade.Shader(source.GetPrim())
    channel = CHANNELS.get(source.GetName().removeprefix("outputs:"))
    file = _source(shader, "file")
    if shader.GetShaderId() != PICTURE or channel is None or file is None:
        return None
    asset = file.Get()
    name = "" if asset is None else asset.resolvedPath or asset.path
    if not name:
        return None
    texture = _texture(name, content, folders)
    scale, bias = (_source(shader, key) for key in ("scale", "bias"))
    if texture is None or (bias is not None and np.any(bias.Get())):
        return None
    factor = 1.0 if scale is None else float(scale.Get()[channel])
    space = _source(shader, "sourceColorSpace")
    linear = space is not None and space.Get() == "raw"
    texture = replace(texture, name=asset.path, fits=_fits(shader), linear=linear)
    return texture, channel, factor


def _texture(name: str, content: Content, folders: Folders) -> Texture | None:
    """Return the texture of a name, which may be that of a file in a package."""
    package, bracket, inner = name.partition("[")
    if not bracket:
        return content.texture(name, folders.roots[0], folders, "texture")
    folders.check_inside(Path(package), package, "texture")
    if (data := read_from_package(name)) is None:
        content.note(f"texture: no file {quoted(inner.rstrip(']'))} in the package; it is not used")
        return None
    return Texture(inner.rstrip("]"), data)


def _fits(texture: Any) -> bool:
    """Return whether a texture uses the mesh's texture coordinates."""
    from pxr import UsdShade

    source = _source(texture, "st")
    if source is None or not _is_picture(source):
        return False
    reader = UsdShade.Shader(source.GetPrim())
    name = _source(reader, "varname")
    return reader.GetShaderId() == COORDINATES and name is not None and name.Get() == PRIMVAR
