"""`spisim scenes list`: what is shipped."""

import yaml

from ..console import print_json, results
from ..options import Json

EXAMPLE = "spisim scenes list"


def command(json: Json = False) -> None:
    """List the shipped scenes, and the families that scenes are drawn from."""
    from rich.table import Table

    from spisim.families import FAMILIES, ranges
    from spisim.scene import list_scenes, load_scene, scenes_folder

    scenes = [load_scene(name) for name in list_scenes()]
    if json:
        rows = [
            {
                "name": scene.name,
                "description": _description(scene.text),
                "objects": len(scene.objects),
                "visibility_m": scene.atmosphere.visibility_m,
            }
            for scene in scenes
        ]
        families = {
            name: {"description": family.description, "parameters": ranges(family.parameters)}
            for name, family in FAMILIES.items()
        }
        print_json({"folder": scenes_folder(), "scenes": rows, "families": families})
        return
    table = Table("scene", "what it is", "objects", "visibility", box=None, header_style="dim")
    for scene in scenes:
        visibility = scene.atmosphere.visibility_m
        fog = "clear" if visibility is None else f"{visibility:g} m"
        table.add_row(scene.name, _description(scene.text), str(len(scene.objects)), fog)
    results.print(table)
    table = Table("family", "what it draws", box=None, header_style="dim")
    for family in FAMILIES.values():
        table.add_row(family.name, family.description)
    results.print()
    results.print(table)
    results.print(f"\nFiles to copy and change: {scenes_folder()}", soft_wrap=True)


def _description(text: str) -> str:
    """What a scene file says that it is."""
    return str(yaml.safe_load(text).get("description", ""))
