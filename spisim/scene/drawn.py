"""Scenes of a family, redrawn until a drone can fly in them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import trimesh

from reconstruction.base.errors import InputError, naming
from spisim.base.config import check_fields
from spisim.scene import families
from spisim.scene.assemble import assemble
from spisim.scene.description import DrawnDescription, SceneDescription
from spisim.scene.layout import OFFERED, layout_problem
from spisim.scene.load_context import LoadContext
from spisim.scene.model import Scene

#: Fields that say what to draw; the drawn sections replace them.
DRAWING = ("family", "seed", "parameters")
#: Draws before a family counts as impossible with the given parameters.
ATTEMPTS = 40


@dataclass(frozen=True)
class Drawn:
    """A scene of a family, with the equivalent complete scene file and its meshes."""

    scene: Scene
    fields: Mapping[str, Any]
    meshes: Mapping[str, trimesh.Trimesh]


def draw(fields: Mapping[str, Any], context: LoadContext) -> Drawn:
    """Scene of a family, from the fields of a scene file.

    The draw depends on family, seed and parameters alone, not on the file's own sections.
    """
    builder = builder_of(fields, context)
    whole = whole_file(fields, builder)
    scene = assemble(check_fields(whole, SceneDescription, context.source), context, builder.meshes)
    return Drawn(scene, whole, builder.meshes)


def builder_of(fields: Mapping[str, Any], context: LoadContext) -> families.SceneBuilder:
    """Sections of a family's draw, for which no file is opened."""
    described = check_fields(fields, DrawnDescription, context.source)
    drawn_from = described.model_dump_json(include=set(DRAWING))
    return context.cache.builder(drawn_from, lambda: _sound_builder(described, context))


def _sound_builder(described: DrawnDescription, context: LoadContext) -> families.SceneBuilder:
    """The first draw in which a drone can fly, see and range."""
    source, alone = context.source, LoadContext(Path(), "", context.source, cache=context.cache)
    with naming(source):
        family = families.FAMILIES[described.family]
    needed = replace(OFFERED, min_spots=family.min_spots)
    problem: str | None = ""
    for attempt in range(ATTEMPTS):
        builder = families.build(
            described.family,
            described.seed,
            described.parameters,
            attempt=attempt,
            source=f"{source}: parameters",
        )
        whole = SceneDescription.model_validate(whole_file({"family": described.family}, builder))
        scene = assemble(whole, alone, builder.meshes)
        problem = layout_problem(scene, needed)
        if problem is None:
            return builder
    raise InputError(
        f"{source}: family {described.family}, seed {described.seed}: none of {ATTEMPTS} draws "
        f"makes a scene to fly in; in the last, {problem}; change the parameters"
    )


def whole_file(fields: Mapping[str, Any], builder: families.SceneBuilder) -> dict[str, Any]:
    """Fields of the complete scene file: the builder's, overridden by the file's own sections."""
    own = {name: value for name, value in fields.items() if name not in DRAWING}
    name = f"{fields['family']}-{fields.get('seed', 0)}"
    whole = {"name": name, **own}
    drawn = builder.sections()
    for section in ("drone", "ambient", "materials"):
        both = {**drawn.get(section, {}), **own.get(section, {})}
        whole |= {section: both} if both else {}
    whole["objects"] = [*drawn["objects"], *own.get("objects", ())]
    return whole
