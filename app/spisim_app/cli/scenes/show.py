"""`spisim scenes show`: view a scene without rendering it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..console import print_json, results, say, warn
from ..inputs import instrument_with, scene_with
from ..options import InstrumentOption, Json, Overwrite, SceneArgument, real_option
from ..outputs import files_read
from ..outputs import output as named
from ..tables import plain_table, print_table

if TYPE_CHECKING:
    from spisim_app.report.scene_view import Spot, Survey

EXAMPLE = "spisim scenes show warehouse -o warehouse.png"


def command(
    scene: SceneArgument,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PNG", help="Image file; by default SCENE.png."),
    ] = None,
    instrument: InstrumentOption = "paper",
    fov: Annotated[
        float,
        real_option("Of the drone's view in the picture.", minimum=5, maximum=150, metavar="DEG"),
    ] = 50.0,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Draw a scene from the drone, above and the right, with fields and spots; list the distances.

    The drawing is in clear air, by ray casting: fast, without light transport.
    """
    from reconstruction.base.folders import output_files
    from spisim.transport import RayCaster
    from spisim_app.report.scene_view import Look, survey, write_look

    picture = output or Path(f"{Path(scene).stem}.png")
    files = [named(picture, "scene view")]
    with output_files(files, files_read(scene, instrument), overwrite=overwrite):
        carried = instrument_with(instrument)
        loaded, oddities = scene_with(scene, carried.wavelength_nm)
        caster = RayCaster.of(loaded)
        drawn = survey(loaded, carried, caster)
        write_look(picture, Look(loaded, carried, caster, drawn), fov)
        problems = [] if drawn.problem is None else [f"scene {loaded.name!r}: {drawn.problem}"]
        warn(problems)
        if json:
            print_json({**drawn.summary(), "warnings": oddities + problems, "written": [picture]})
            return
        _print(drawn)
        say(f"Wrote {picture}.")


def _print(drawn: Survey) -> None:
    table = plain_table("distances", "m", "to")
    table.add_row("nearest in the field", *_cells(drawn.nearest))
    for k, spot in enumerate(drawn.spots):
        table.add_row(f"spot {k}", *_cells(spot))
    table.add_row("farthest in the field", *_cells(drawn.farthest))
    table.add_row("drone's clearance", f"{drawn.clearance_m:.3f}", "")
    print_table(table)
    for number, why in drawn.lost.items():
        results.print(f"spot {number} {why}: it gives no range", style="yellow", soft_wrap=True)
    size = " × ".join(f"{side:.0f}" if side >= 100 else f"{side:.3g}" for side in drawn.extents_m)
    media = ", ".join(f"{medium['where']}: {medium['kind']}" for medium in drawn.media)
    results.print(
        f"\n{drawn.name}: {drawn.objects} objects, {drawn.triangles:,} triangles, {size} m; "
        f"{media or 'clear air'}",
        soft_wrap=True,
    )
    for lamp in drawn.lamps:
        results.print(
            f"lamp {lamp['name']}: {lamp['type']}, {lamp['quantity']} {lamp['amount']:.4g} "
            f"{lamp['unit']}",
            soft_wrap=True,
        )


def _cells(spot: Spot) -> tuple[str, str]:
    distance = f"{spot.range_m:.3f}" if math.isfinite(spot.range_m) else "–"
    return distance, spot.object or "nothing"
