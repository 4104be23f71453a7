"""`spisim scenes draw`: a scene of a family as editable files."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from reconstruction.base.errors import InputError

from ..console import print_json, say, warn
from ..options import Json, Overwrite, Seed

EXAMPLE = "spisim scenes draw targets --seed 7 --set target=siemens-star -o star.yaml"


def command(
    family: Annotated[str, typer.Argument(metavar="FAMILY", help="See `spisim scenes list`.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="YAML", help="Scene file.")],
    seed: Seed = 0,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A parameter of the family, see `spisim scenes list FAMILY`; repeatable.",
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Draw a scene: writes its file, and its meshes into a folder beside it.

    To simulate a drawn scene, a scene file of two lines, "family: targets" and "seed: 7", is
    enough, because it is drawn when loaded.
    """
    from spisim.scene.drawn import draw
    from spisim.scene.load_context import LoadContext
    from spisim.scene.write import check_free, write_scene

    check_free(output, overwrite)
    fields = {"family": family, "seed": seed, "parameters": _parameters(settings or [])}
    drawn = draw(fields, LoadContext(Path(), "", f"family {family}"))
    given = "".join(f" --set {shlex.quote(assignment)}" for assignment in settings or [])
    header = f"# Drawn by `spisim scenes draw {family} --seed {seed}{given}`.\n"
    written = write_scene(output, drawn.fields, drawn.meshes, header)
    warn(written.warnings)
    files = [written.scene_file, *written.mesh_files]
    if json:
        print_json({"written": files, "warnings": written.warnings})
    else:
        say(f"Wrote {output}; its meshes: {len(files) - 1}.")
        say(f"Look at it: spisim scenes show {shlex.quote(str(output))}")


def _parameters(settings: list[str]) -> dict[str, object]:
    from spisim.base.config import load_yaml

    parameters = {}
    for assignment in settings:
        name, sign, value = assignment.partition("=")
        if not sign:
            raise InputError(f"--set {assignment}: should be NAME=VALUE")
        try:
            parameters[name] = load_yaml(value, "--set")
        except InputError:
            raise InputError(f"--set {assignment}: {value!r} is not a valid value") from None
    return parameters
