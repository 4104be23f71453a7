"""What the materials of a glTF file say: names, colours, pictures of colours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from reconstruction.errors import InputError
from spisim.scene.importing.files import Folders, shown
from spisim.scene.importing.gltf_buffers import Buffers, unquoted, within
from spisim.scene.importing.model import Content, Surface
from spisim.scene.importing.textures import Texture

#: Extensions that name another picture of the same, in a format that may be read where its is not.
OTHER_PICTURES = ("EXT_texture_webp", "MSFT_texture_dds", "KHR_texture_basisu")
SPECULAR = "KHR_materials_pbrSpecularGlossiness"


def read_surfaces(
    header: dict[str, Any], buffers: Buffers, path: Path, folders: Folders, content: Content
) -> list[Surface]:
    """Of all materials, in the file's order; notes pictures that are missing."""
    images = [
        _image(number, row, buffers, path, folders, content)
        for number, row in enumerate(header.get("images", []))
    ]
    textures = [_found(row, images) for row in header.get("textures", [])]
    surfaces = []
    for number, row in enumerate(header.get("materials", [])):
        try:
            surfaces.append(_surface(row, textures))
        except (AttributeError, IndexError, KeyError, TypeError, ValueError):
            content.note(f"material {number} is damaged: it is not used")
            surfaces.append(Surface())
    return surfaces


def _surface(row: dict[str, Any], textures: list[Texture | None]) -> Surface:
    extensions = row.get("extensions", {})
    pbr = row.get("pbrMetallicRoughness", {})
    color, picture = pbr.get("baseColorFactor"), pbr.get("baseColorTexture")
    if SPECULAR in extensions and picture is None and color is None:
        color = extensions[SPECULAR].get("diffuseFactor")
        picture = extensions[SPECULAR].get("diffuseTexture")
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


def _texture(picture: dict[str, Any], red: float, textures: list[Texture | None]) -> Texture | None:
    """The texture that a material refers to, times a red; None where it is not there."""
    number: Any = picture.get("index")
    found = dict(enumerate(textures)).get(number)
    if found is None:
        return None
    moved = "KHR_texture_transform" in picture.get("extensions", {})
    return replace(found, factor=red, fits=picture.get("texCoord", 0) == 0 and not moved)


def _found(row: dict[str, Any], images: list[Texture | None]) -> Texture | None:
    """The picture of a texture, in whichever format there is."""
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
        content.note(f"{shown(name)} is damaged: this texture is not used")
        return None
    return content.texture(unquoted(uri), path.parent, folders, "texture")
