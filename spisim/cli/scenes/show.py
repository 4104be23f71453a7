"""`spisim scenes show`: a scene, looked at before anything is rendered."""

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
    from spisim.report.scene_view import Spot, Survey

EXAMPLE = "spisim scenes show warehouse -o warehouse.png"


def command(
    scene: SceneArgument,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="PNG", help="Picture; SCENE.png without."),
    ] = None,
    instrument: InstrumentOption = "paper",
    fov: Annotated[
        float,
        real_option("Of the drone's view in the picture.", minimum=5, maximum=150, metavar="DEG"),
    ] = 50.0,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Draw a scene from the drone, above and the right, with fields and spots; tell the distances.

    A drawing in clear air, by ray casting: quick, and without light transport.
    """
    from reconstruction.base.files import require_outputs
    from spisim.report.scene_view import Look, survey, write_look
    from spisim.transport import RayCaster

    picture = output or Path(f"{Path(scene).stem}.png")
    files = [named(picture, "scene view")]
    require_outputs(files, files_read(scene, instrument), overwrite=overwrite)
    carried = instrument_with(instrument)
    position, oddities = scene_with(scene, carried.wavelength_nm)
    caster = RayCaster.of(position)
    result = survey(position, carried, caster)
    write_look(picture, Look(position, carried, caster, result), fov)
    problems = [] if result.problem is None else [f"scene {position.name!r}: {result.problem}"]
    warn(problems)
    if json:
        print_json({**result.summary(), "warnings": oddities + problems, "written": [picture]})
        return
    _print(result)
    say(f"Wrote {picture}.")


def _print(result: Survey) -> None:
    table = plain_table("distances", "m", "to")
    table.add_row("nearest in the field", *_cells(result.nearest))
    for k, spot in enumerate(result.spots):
        table.add_row(f"spot {k}", *_cells(spot))
    table.add_row("farthest in the field", *_cells(result.farthest))
    table.add_row("drone's clearance", f"{result.clearance_m:.3f}", "")
    print_table(table)
    for number, why in result.lost.items():
        results.print(f"spot {number} {why}: it gives no range", style="yellow", soft_wrap=True)
    size = " × ".join(f"{side:.0f}" if side >= 100 else f"{side:.3g}" for side in result.extents_m)
    media = ", ".join(f"{medium['where']}: {medium['kind']}" for medium in result.media)
    results.print(
        f"\n{result.name}: {result.objects} objects, {result.triangles:,} triangles, {size} m; "
        f"{media or 'clear air'}",
        soft_wrap=True,
    )
    for lamp in result.lamps:
        results.print(
            f"lamp {lamp['name']}: {lamp['type']}, {lamp['quantity']} {lamp['amount']:.4g} "
            f"{lamp['unit']}",
            soft_wrap=True,
        )


def _cells(spot: Spot) -> tuple[str, str]:
    distance = f"{spot.range_m:.3f}" if math.isfinite(spot.range_m) else "–"
    return distance, spot.object or "nothing"
