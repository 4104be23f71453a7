"""Pages of the reference that are made from the program: files, commands, Python, materials.

`make docs` adds them to the site; none is committed. Docstrings and the descriptions of fields are
their text.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

import file_references
import material_plot

ROOT = Path(__file__).parents[1]

#: Packages whose every package has a section on a page, and those from beside them on that page.
PYTHON: dict[str, list[str]] = {
    "reconstruction": [
        "spisim_live",
        "spisim_live.links",
        "spisim_live.mavlink",
        "spisim_live.sinks",
    ],
    "spisim": ["spisim_formats", "spisim_app.report.scene_view", "spisim_app.report.viewer"],
}
_BEHIND = "---\nsearch:\n  boost: 0.01 # pages that explain come first\n---\n"


def pages() -> dict[str, str]:
    """Text of each page, by its name within the folder of the reference."""
    return {
        **file_references.pages(),
        "commands.md": "\n".join(_commands()),
        "materials.md": "\n".join(_materials()),
        "python.md": "\n".join(_python()),
        **{f"python-{root}.md": "\n".join(_packages(root)) for root in PYTHON},
    }


def public_names() -> dict[str, list[str]]:
    """Names of each `__all__`, by package."""
    result = {}
    for root in PYTHON:
        for path in sorted((ROOT / root).rglob("__init__.py")):
            for statement in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(statement, ast.Assign) and "__all__" in ast.unparse(statement):
                    package = ".".join(path.parent.relative_to(ROOT).parts)
                    result[package] = ast.literal_eval(statement.value)
    return result


def namesakes(package: str, names: list[str]) -> list[str]:
    """Names that are their module's too: mkdocstrings would show the module in their place."""
    folder = ROOT.joinpath(*package.split("."))
    return [f"{package}.{name}.{name}" for name in names if (folder / f"{name}.py").is_file()]


def _python() -> Iterator[str]:
    yield _BEHIND
    yield "# Python\n"
    yield (
        "The public names of `spisim` and `reconstruction`. Further names are public where a "
        "package [of the reconstruction](python-reconstruction.md) or [of the "
        "simulator](python-spisim.md) lists them in its `__init__`. Shapes are in brackets, units "
        "in the names.\n"
    )
    names = public_names()
    for root in ("spisim", "reconstruction"):
        yield f"## {root}\n"
        yield from (f"::: {root}.{name}" for name in names[root] if name != "__version__")
        yield ""


def _packages(root: str) -> Iterator[str]:
    yield _BEHIND
    yield f"# Python: packages of {root}\n"
    yield f"What each package of `{root}` lists in its `__init__`.\n"
    for package, names in public_names().items():
        if package.startswith(f"{root}."):
            yield from (f"::: {name}" for name in (package, *namesakes(package, names)))
    yield from (f"::: {package}" for package in PYTHON[root])


def _materials() -> Iterator[str]:
    yield "# Materials\n"
    yield (
        "Names for `material` in a scene file, with the reflectance at five wavelengths (nm). "
        "[Theory](../theory/materials.md) says what a row is worth; [a material of your "
        "own](../howto/material.md) goes into the scene file. Without a model a row is diffuse. A "
        "row whose model refracts holds what follows at normal incidence; `plastic` and "
        "`rough-plastic` hold the body beneath the coat.\n"
    )
    yield from material_plot.table()
    yield (
        "\nSources: SBUL is Herold et al. (2004), Remote Sensing of Environment 91, 304; JFSP the "
        "Joint Fire Science Program; ISRIC the ICRAF-ISRIC soil library; PROSAIL a model of "
        "canopies; all four as distributed with earthlib 1.1.0. ECOSTRESS is Meerdink et al. "
        "(2019), Remote Sensing of Environment 230, 111196. USGS is Clark et al. (2007), Digital "
        "Spectral Library splib06a, Data Series 231, in the bands of CRISM.\n"
    )


def _commands() -> Iterator[str]:
    """Every command of `spisim` with its arguments and options."""
    from spisim_app.cli import app

    yield "# Commands\n"
    yield (
        "`spisim COMMAND --help` prints the same. The rig's package has its own commands: `python "
        "-m reconstruction --help` lists them. Exit status: 0 done; 1 done, but something failed "
        "or differs; 2 input or files that cannot be used; 3 no space; 130 interrupted.\n"
    )
    yield from _verb(typer.main.get_command(app), "spisim")


def _verb(command: Any, called: str) -> Iterator[str]:
    if called != "spisim":
        yield f"\n## `{called}`\n\n{(command.help or '').strip()}\n"
        yield from _parameters(command)
        if command.epilog:
            yield f"\n`{command.epilog.removeprefix('Example: ')}`\n"
    for name, verb in getattr(command, "commands", {}).items():
        yield from _verb(verb, f"{called} {name}")


def _parameters(command: Any) -> Iterator[str]:
    visible = [each for each in command.params if not getattr(each, "hidden", False)]
    if not visible:
        return
    yield "| option | default | what it is |\n|---|---|---|"
    for each in visible:
        names = ", ".join(f"`{name}`" for name in [*each.opts, *each.secondary_opts])
        names = names if each.param_type_name == "option" else f"`{each.metavar or each.name}`"
        default = "" if each.default in (None, False, ()) else f"`{each.default}`"
        default = "**needed**" if each.required else default
        what = re.sub(r"\s+", " ", getattr(each, "help", None) or "").replace("|", "\\|")
        yield f"| {names} | {default} | {what} |"
