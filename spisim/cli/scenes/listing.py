"""`spisim scenes list`: what is shipped, and what can be drawn."""

from ..console import print_json, results
from ..options import Json

EXAMPLE = "spisim scenes list"


def command(json: Json = False) -> None:
    """List the shipped scenes, and the families that scenes are drawn from."""
    from rich.table import Table

    from spisim.families import FAMILIES, ranges
    from spisim.scene import catalogue, scenes_folder

    scenes = catalogue()
    if json:
        families = {
            name: {"description": family.description, "parameters": ranges(family.parameters)}
            for name, family in FAMILIES.items()
        }
        rows = [vars(entry) for entry in scenes]
        print_json({"folder": scenes_folder(), "scenes": rows, "families": families})
        return
    table = Table("scene", "what it is", "air", box=None, header_style="dim")
    for entry in scenes:
        table.add_row(entry.name, entry.description, ", ".join(entry.weather) or "clear")
    results.print(table)
    table = Table("family", "what it draws", box=None, header_style="dim")
    for family in FAMILIES.values():
        table.add_row(family.name, family.description)
    results.print()
    results.print(table)
    results.print(
        f"\nTo look at one: spisim scenes show NAME. Files to copy and change: {scenes_folder()}",
        soft_wrap=True,
    )
