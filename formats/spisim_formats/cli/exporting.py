"""`spisim scenes export`: export scenes to other programs."""

from pathlib import Path
from typing import Annotated

import typer

from spisim_app.cli.console import print_json, say
from spisim_app.cli.inputs import instrument_with, scene_with
from spisim_app.cli.options import Json, Overwrite, SceneArgument
from spisim_app.cli.outputs import files_read

EXAMPLE = "spisim scenes export warehouse -o warehouse.glb"


def command(
    scene: SceneArgument,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FILE", help=".glb (Blender) or .sdf (Gazebo)."),
    ],
    instrument: Annotated[
        str | None,
        typer.Option(
            help="Put an instrument's camera and rays into a world of Gazebo, where the drone "
            "is: an instrument file, or the name of a preset."
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Write a scene for Blender (.glb) or Gazebo (.sdf, with a folder of meshes beside it).

    It exports triangles, names and names of materials, which `spisim scenes import` reads back, and
    daylight to Gazebo. Weather, motion and textures are left out.
    """
    from reconstruction.base.files import Output
    from reconstruction.base.folders import output_files
    from spisim_formats import export_scene
    from spisim_formats.sdf.sensors import sensor_elements

    loaded, _ = scene_with(str(scene), 1550.0)
    read = list(files_read(*([scene] if instrument is None else [scene, instrument])))
    sensors = []
    if instrument is not None:
        sensors = sensor_elements(instrument_with(instrument), loaded.drone_pose)
    with output_files([Output(output, "scene")], read, overwrite=True):
        files = export_scene(loaded, output, overwrite, sensors, read)
    if json:
        print_json({"written": files, "objects": len(loaded.objects)})
        return
    say(f"Wrote {output}; files beside it: {len(files) - 1}.")
