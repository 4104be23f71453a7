"""What the materials of a glTF file say: names, colours, pictures of colours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError
from spisim_formats.gltf.buffers import Buffers, unquoted, within
from spisim_formats.library.content import Content, Surface
from spisim_formats.library.files import Folders, quoted
from spisim_formats.library.metallic import Metallic
from spisim_formats.library.opacity import Opacity, cut, uniform
from spisim_formats.library.source_material import SourceMaterial
from spisim_formats.library.textures import Texture, read_channels

#: Extensions that name another picture of the same, in a format that may be read where its is not.
OTHER_PICTURES = ("EXT_texture_webp", "MSFT_texture_dds", "KHR_texture_basisu")
SPECULAR = "KHR_materials_pbrSpecularGlossiness"
#: Extensions that make a surface of another kind, those that are layers of it, and those kept.
OTHERS = (
    SPECULAR,
    "KHR_materials_unlit",
    "KHR_materials_transmission",
    "KHR_materials_diffuse_transmission",
)
LAYER = "KHR_materials_"
RETAINED = ("KHR_materials_ior", "KHR_materials_specular", "KHR_materials_emissive_strength")
#: What the channels of pictures are of.
CHANNELS = {
    "baseColorTexture": {"base": 0},
    "metallicRoughnessTexture": {"roughness": 1, "metal": 2},
}


def read_surfaces(
    header: dict[str, Any], buffers: Buffers, path: Path, folders: Folders, content: Content
) -> list[Surface]:
    """Of all materials, in the file's order; notes pictures that are missing."""
    images = [
        _image(number, row, buffers, path, folders, content)
        for number, row in enumerate(header.get("images", []))
    ]
    textures = [_texture_image(row, images) for row in header.get("textures", [])]
    surfaces = []
    for number, row in enumerate(header.get("materials", [])):
        try:
            surface = _surface(row, textures)
            what, opaque = f"material {number}", partial(_opacity, row, textures)
            opacity = cache(partial(content.attempt, f"{what}: opacity", opaque))
            whole = partial(_source_material, row, textures, opacity)
            source = cache(partial(content.attempt, what, whole))
            surfaces.append(replace(surface, source=source, opacity=opacity))
        except (AttributeError, IndexError, KeyError, TypeError, ValueError):
            content.note(f"material {number} is damaged: it is not used")
            surfaces.append(Surface())
    return surfaces


def _base(row: dict[str, Any]) -> tuple[Any, Any]:
    """Return the factor of a material's colour and opacity, and its picture."""
    extensions, pbr = row.get("extensions", {}), row.get("pbrMetallicRoughness", {})
    color, picture = pbr.get("baseColorFactor"), pbr.get("baseColorTexture")
    if SPECULAR in extensions and picture is None and color is None:
        glossy = extensions[SPECULAR]
        return glossy.get("diffuseFactor"), glossy.get("diffuseTexture")
    return color, picture


def _surface(row: dict[str, Any], textures: list[Texture | None]) -> Surface:
    extensions = row.get("extensions", {})
    pbr = row.get("pbrMetallicRoughness", {})
    color, picture = _base(row)
    words: tuple[str, ...] = ()
    if "KHR_materials_transmission" in extensions:
        words = ("dielectric",)
    elif pbr.get("metallicFactor", 1 if color else 0) >= 0.5 and picture is None:
        words = ("metal",)
    if picture is not None:
        red = 1.0 if color is None else float(color[0])
        return Surface(row.get("name"), None, words, _texture(picture, red, textures))
    if color is None:
        return Surface(row.get("name"), None, words)
    red, green, blue = (float(value) for value in color[:3])
    return Surface(row.get("name"), (red, green, blue), words)


def _opacity(row: dict[str, Any], textures: list[Texture | None]) -> Opacity | None:
    """Return what of a material is opaque: alpha cut off, or blended."""
    mode = row.get("alphaMode", "OPAQUE")
    if mode not in ("MASK", "BLEND"):
        return None
    color, picture = _base(row)
    alpha = 1.0 if color is None else float(color[3])
    cutoff = float(row.get("alphaCutoff", 0.5)) if mode == "MASK" else None
    if picture is None:
        return uniform(alpha, cutoff)
    texture = _texture(picture, 1.0, textures)
    if texture is None:
        raise InputError("its picture is missing")
    (fraction,) = read_channels(texture, 3)
    return cut(alpha * fraction, cutoff, fits=texture.fits)


def _source_material(
    row: dict[str, Any], textures: list[Texture | None], opacity: Callable[[], Opacity | None]
) -> SourceMaterial | None:
    """Return a surface of all that a material says; None where that is not by metalness."""
    surface = _metallic(row, textures, opacity)
    return None if surface is None else surface.source_material()


def _metallic(
    row: dict[str, Any],
    textures: list[Texture | None],
    opacity: Callable[[], Opacity | None],
) -> Metallic | None:
    extensions = row.get("extensions", {})
    if "pbrMetallicRoughness" not in row or set(OTHERS) & set(extensions):
        return None
    pbr = row["pbrMetallicRoughness"]
    red = float(pbr.get("baseColorFactor", (1, 1, 1, 1))[0])
    gloss = extensions.get("KHR_materials_specular", {})
    pictures: dict[str, tuple[Texture, int]] = {}
    for name, channels in CHANNELS.items():
        result = _texture(pbr[name], 1.0, textures) if name in pbr else None
        if result is None and name in pbr:
            return None
        if result is not None:
            pictures |= {what: (result, channel) for what, channel in channels.items()}
    odd = ["its bumps are left out"] if "normalTexture" in row else []
    if any(row.get("emissiveFactor", ())):
        odd.append("its own light is left out")
    odd += [
        f"its {name.removeprefix(LAYER)} is left out"
        for name in extensions
        if name.startswith(LAYER) and name not in RETAINED
    ]
    return Metallic(
        red,
        float(pbr.get("metallicFactor", 1.0)),
        float(pbr.get("roughnessFactor", 1.0)),
        float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5)),
        float(gloss.get("specularFactor", 1.0)),
        opacity(),
        pictures,
        tuple(odd),
    )


def _texture(picture: dict[str, Any], red: float, textures: list[Texture | None]) -> Texture | None:
    """The texture that a material refers to, times a red; None where it is not there."""
    number: Any = picture.get("index")
    result = dict(enumerate(textures)).get(number)
    if result is None:
        return None
    moved = "KHR_texture_transform" in picture.get("extensions", {})
    return replace(result, factor=red, fits=picture.get("texCoord", 0) == 0 and not moved)


def _texture_image(row: dict[str, Any], images: list[Texture | None]) -> Texture | None:
    """Return the image of a texture in the first readable format."""
    extensions = row.get("extensions", {})
    others = (extensions[name].get("source") for name in OTHER_PICTURES if name in extensions)
    numbers = (each for each in (row.get("source"), *others) if each in range(len(images)))
    return next((images[each] for each in numbers if images[each] is not None), None)


def _image(
    number: int,
    row: dict[str, Any],
    buffers: Buffers,
    path: Path,
    folders: Folders,
    content: Content,
) -> Texture | None:
    """A picture beside the file, in its text, or in its buffers."""
    uri = row.get("uri")
    name = row.get("name") or f"image {number}"
    try:
        if uri is None:
            return Texture(name, bytes(buffers.view(row.get("bufferView"))))
        if uri.startswith("data:"):
            return Texture(name, within(uri))
    except (InputError, ValueError):
        content.note(f"{quoted(name)} is damaged: this texture is not used")
        return None
    return content.texture(unquoted(uri), path.parent, folders, "texture")
