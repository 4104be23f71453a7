"""Scenes of a family: drawn until the instrument can fly in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import trimesh

from reconstruction.errors import InputError
from spisim import families
from spisim.config import check_fields
from spisim.scene.assemble import Setting, assemble
from spisim.scene.description import DrawnDescription, SceneDescription
from spisim.scene.layout import layout_problem
from spisim.scene.model import Scene

#: Fields that tell how to draw; what they draw takes their place.
DRAWING = ("family", "seed", "parameters")
#: Draws that are tried before a family counts as impossible with the parameters given.
ATTEMPTS = 40


@dataclass(frozen=True)
class Drawn:
    """A scene of a family, and the whole scene file that says the same, with its meshes."""

    scene: Scene
    fields: Mapping[str, Any]
    meshes: Mapping[str, trimesh.Trimesh]


def draw(fields: Mapping[str, Any], setting: Setting) -> Drawn:
    """The first scene of a family that has a sound layout, from the fields of a scene file.

    Raises InputError, naming the source, for fields that do not fit, an unknown family, unknown
    parameters, and where none of many draws has a sound layout.
    """
    source = setting.source
    described = check_fields(fields, DrawnDescription, source)
    problem: str | None = ""
    for attempt in range(ATTEMPTS):
        draft = families.draft(
            described.family,
            described.seed,
            described.parameters,
            attempt=attempt,
            source=f"{source}: parameters",
        )
        whole = whole_file(fields, draft)
        scene = assemble(check_fields(whole, SceneDescription, source), setting, draft.meshes)
        problem = layout_problem(scene)
        if problem is None:
            return Drawn(scene, whole, draft.meshes)
    raise InputError(
        f"{source}: family {described.family}, seed {described.seed}: none of {ATTEMPTS} draws is "
        f"a scene to fly in; in the last, {problem}; change parameters or drone"
    )


def whole_file(fields: Mapping[str, Any], draft: families.Draft) -> dict[str, Any]:
    """Fields of the scene file that says in full what a draft and a file's own sections say."""
    own = {name: value for name, value in fields.items() if name not in DRAWING}
    name = f"{fields['family']}-{fields.get('seed', 0)}"
    whole = {"name": name, **own}
    drawn = draft.sections()
    for section in ("drone", "ambient", "materials"):
        both = {**drawn.get(section, {}), **own.get(section, {})}
        whole |= {section: both} if both else {}
    whole["objects"] = [*drawn["objects"], *own.get("objects", ())]
    return whole
