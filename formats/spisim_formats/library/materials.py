"""Find the material of a surface: by name, word, texture or colour."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import yaml
from pydantic import RootModel, ValidationError

from reconstruction.base.errors import InputError, nearest
from spisim.base.config import load_yaml, read_text
from spisim.scene.materials import material_table
from spisim_formats.library.content import Part, Surface
from spisim_formats.library.source_material import SourceMaterials
from spisim_formats.library.textures import Pictured

WHITE, BLACK = 0.8, 0.04


@dataclass(frozen=True)
class Match:
    """The material chosen for a surface, and how it was decided."""

    source: str
    material: str
    how: str  # "map", "file", "name", "guess", "texture" or "default"
    why: str


class _Map(RootModel[dict[str, str]]):
    """A file of {name in the source: material of spisim}."""


def read_map(path: Path) -> dict[str, str]:
    """Read the user's {name in the source: material}. Raises InputError for unknown materials."""
    text = read_text(path)
    try:
        rows = _Map.model_validate(load_yaml(text, path)).root
    except (InputError, ValidationError):
        raise InputError(
            f"{path}: expected lines of `name in the source: material of spisim`"
        ) from None
    available = sorted(material_table())
    for source, material in rows.items():
        if material not in available:
            raise InputError(
                f"{path}: {source}: unknown material {material!r}: {nearest(material, available)}"
            )
    return rows


def check_map(chosen: Mapping[str, str], parts: list[Part], path: Path) -> None:
    """Raise InputError for a name in a map that no part has."""
    there = list(dict.fromkeys(part.surface.label for part in parts))
    for source in chosen:
        if source not in there:
            raise InputError(
                f"{path}: the file has no material {source!r}: {nearest(source, there)}"
            )


def match(
    part: Part,
    chosen: Mapping[str, str],
    pictured: Pictured,
    sources: SourceMaterials | None = None,
) -> Match:
    """Choose the material of a part: the user's, else by name, word, texture or colour.

    `pictured` makes and stores materials from textures, and `sources` those of the file itself, if
    given.
    """
    surface = part.surface
    label = surface.label
    if label in chosen:
        return Match(label, chosen[label], "map", "--materials")
    if (
        sources is not None
        and surface.source is not None
        and (whole := surface.source()) is not None
    ):
        return Match(label, *_swapped("file", sources.material(label, whole, part.geometry)))
    if surface.name is not None and (exact := _exact(surface.name)):
        return Match(label, exact, "name", "of this name")
    for what, text in _clues(part):
        if result := _by_words(text):
            words, material = result
            return Match(label, material, "guess", f"{words!r} in {what} {text!r}")
    texture = surface.texture
    if texture is not None and (made := pictured.material(texture, part.geometry)):
        return Match(label, made[0], "texture", made[1])
    return _by_color(surface)


def _swapped(how: str, result: tuple[str, str]) -> tuple[str, str, str]:
    return result[0], how, result[1]


def _clues(part: Part) -> list[tuple[str, str]]:
    clues = [("its name", part.surface.name)] if part.surface.name else []
    clues += [("its description", word) for word in part.surface.words]
    if part.surface.texture is not None:
        clues.append(("its texture", part.surface.texture.stem))
    return [*clues, ("the object's name", part.name)]


def _exact(name: str) -> str | None:
    plain = "-".join(_words(name))
    return plain if plain in material_table() else None


def _by_color(surface: Surface) -> Match:
    keywords = _keywords()
    if surface.color is None:
        return Match(surface.label, keywords["nothing"], "default", "nothing tells what it is")
    color = ", ".join(f"{value:.2f}" for value in surface.color)
    if min(surface.color) >= WHITE:
        kind = "white"
    elif max(surface.color) <= BLACK:
        kind = "black"
    else:
        return Match(surface.label, keywords["colored"], "default", f"only a colour ({color})")
    return Match(surface.label, keywords[kind], "guess", f"{kind} ({color})")


def _by_words(text: str) -> tuple[str, str] | None:
    """Return the entry of the table that fits a text best, and its material."""
    return _best_entry(tuple(_words(text)))


@lru_cache(maxsize=4096)  # worlds have thousands of `tree_1`
def _best_entry(there: tuple[str, ...]) -> tuple[str, str] | None:
    fitting = {
        (phrase, material): whole
        for phrase, material in _keywords()["words"].items()
        if (whole := _whole_words(there, phrase.split())) is not None
    }
    if not fitting:
        return None
    return max(fitting, key=lambda entry: (len(entry[0].split()), fitting[entry]))


def _whole_words(there: Sequence[str], phrase: list[str]) -> int | None:
    """Count the words of a phrase that stand alone; None unless all of them occur."""
    whole = [word in there or f"{word}s" in there for word in phrase]
    inside = [any(word in _halves(name) for name in there) for word in phrase]
    if not all(alone or part for alone, part in zip(whole, inside, strict=True)):
        return None
    return sum(whole)


@cache
def _halves(name: str) -> tuple[str, ...]:
    """Split a compound into two known words, or none."""
    halves = ((name[:k], name[k:]) for k in range(1, len(name)))
    return next((pair for pair in halves if _vocabulary().issuperset(pair)), ())


@cache
def _vocabulary() -> frozenset[str]:
    """Return all words of the table in singular and plural."""
    words = {word for phrase in _keywords()["words"] for word in phrase.split()}
    words |= set(_keywords()["parts"])
    return frozenset(words | {f"{word}s" for word in words})


def _words(text: str) -> list[str]:
    """Return words of a name like `BrickWall_02.001` in lower case, without numbers."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return re.findall(r"[a-z]+", apart.lower())


@cache
def _keywords() -> dict[str, Any]:
    text = Path(__file__).with_name("keywords.yaml").read_text(encoding="utf-8")
    keywords: dict[str, Any] = yaml.safe_load(text)
    return keywords
