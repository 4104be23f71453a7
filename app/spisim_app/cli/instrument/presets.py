"""`spisim instrument list`, `show` and `copy`: presets as their files are, comments and all."""

from pathlib import Path
from typing import Annotated

import typer

from reconstruction.base.files import Output, require_outputs, write_atomically

from .. import complete
from ..console import print_json, results, say
from ..options import Json, Overwrite
from ..tables import print_table, word_table

LIST_EXAMPLE = "spisim instrument list"
SHOW_EXAMPLE = "spisim instrument show vl53l5cx"
COPY_EXAMPLE = "spisim instrument copy fga015 -o mine.yaml"

Preset = Annotated[
    str, typer.Argument(metavar="NAME", help="A preset.", autocompletion=complete.instruments)
]


def list_command(json: Json = False) -> None:
    """List the presets, with the first sentence of their files."""
    from spisim.instrument.model import PRESETS

    about = {path.stem: _about(path) for path in sorted(PRESETS.glob("*.yaml"))}
    if json:
        print_json({"instruments": about})
        return
    table = word_table("instrument", "what it is")
    for row in about.items():
        table.add_row(*row)
    print_table(table)


def show_command(name: Preset) -> None:
    """Print a preset's file, with its comments and sources."""
    results.print(_text(name), end="", markup=False, highlight=False, soft_wrap=True)


def copy_command(
    name: Preset,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="YAML", help="File to write; else NAME.yaml."),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Copy a preset's file, with its comments and sources, to change it."""
    text = _text(name)
    target = output or Path(f"{name}.yaml")
    require_outputs([Output(target, "instrument file", (".yaml", ".yml"))], overwrite=overwrite)
    write_atomically(target, text.encode())
    say(f"Wrote {target}.")


def _text(name: str) -> str:
    from spisim.base.config import find_named, read_text
    from spisim.instrument.model import PRESETS

    return read_text(find_named(name, PRESETS, "instrument"))


def _about(path: Path) -> str:
    """Return the first sentence of the comment that heads a file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    comment = " ".join(line.lstrip("# ") for line in lines[:head])
    return comment.partition(". ")[0].rstrip(".")
