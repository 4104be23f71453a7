"""`spisim scenes list`: shipped scenes, and families to draw from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..console import print_json, results
from ..options import Json
from ..tables import print_table, word_table

if TYPE_CHECKING:
    from spisim.scene.families import Family

EXAMPLE = "spisim scenes list warehouse"


def command(
    family: Annotated[
        str | None,
        typer.Argument(metavar="FAMILY", help="List the parameters of this family instead."),
    ] = None,
    json: Json = False,
) -> None:
    """List the shipped scenes, and the families that scenes are drawn from."""
    from spisim.scene import catalogue, scenes_folder
    from spisim.scene.families import FAMILIES

    if family is not None:
        _tell(family, FAMILIES[family], json)
        return
    scenes = catalogue()
    if json:
        families = {name: _summary(one) for name, one in FAMILIES.items()}
        rows = [vars(entry) for entry in scenes]
        print_json({"folder": scenes_folder(), "scenes": rows, "families": families})
        return
    _print_table(
        ("scene", "what it is", "air"),
        [(one.name, one.description, ", ".join(one.weather) or "clear") for one in scenes],
    )
    results.print()
    _print_table(
        ("family", "what it draws"), [(name, one.description) for name, one in FAMILIES.items()]
    )
    results.print(
        "\nTo look at one: spisim scenes show NAME. Parameters of a family: spisim scenes list "
        f"FAMILY. Files to copy and change: {scenes_folder()}",
        soft_wrap=True,
    )


def _tell(name: str, family: Family, json: bool) -> None:
    from spisim.scene.families import ranges

    if json:
        print_json(_summary(family))
        return
    fields = family.parameters.model_fields
    _print_table(
        ("parameter", "drawn from", "what it is"),
        [
            (field, _range(row), str(fields[field].description))
            for field, row in ranges(family.parameters).items()
        ],
    )
    results.print(
        f"\n{family.description}. To set one: spisim scenes draw {name} --set NAME=VALUE",
        soft_wrap=True,
    )


def _summary(family: Family) -> dict[str, Any]:
    from spisim.scene.families import ranges

    return {"description": family.description, "parameters": ranges(family.parameters)}


def _range(drawn: dict[str, Any]) -> str:
    """Describe a distribution."""
    if "choice" in drawn:
        return ", ".join(drawn["choice"])
    (low, high) = drawn.get("uniform") or drawn["log_uniform"]
    return f"{low:g} to {high:g}"


def _print_table(columns: tuple[str, ...], rows: list[tuple[str, ...]]) -> None:
    table = word_table(*columns)
    for row in rows:
        table.add_row(*row)
    print_table(table)
