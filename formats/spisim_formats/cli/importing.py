"""`spisim scenes import`: import scenes of other programs."""

from __future__ import annotations

import math
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from reconstruction.base.errors import InputError
from spisim.base.home import home
from spisim_app.cli.console import print_json, results, say, warn
from spisim_app.cli.options import Json, Overwrite, real_option
from spisim_app.cli.tables import print_table, word_table

if TYPE_CHECKING:
    from spisim_formats import Import

Textures = Literal["mean", "picture", "off"]
Lamps = Literal["off", "watts"]
Surfaces = Literal["guess", "file"]
EXAMPLE = "spisim scenes import hangar.glb -o hangar.yaml"

#: Gazebo's search paths for models; --model-path adds others.
SEARCH_PATHS = ("GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH")


def command(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A scene or mesh: .glb .gltf .obj .stl .ply .off .dae .usd .usda .usdc .usdz "
            ".urdf .sdf .world, Mitsuba's .xml.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="YAML", help="Scene file to write.")
    ],
    units: Annotated[
        str, typer.Option(metavar="UNIT", help="mm, cm, m, in, ft, or auto: what the file says.")
    ] = "auto",
    up: Annotated[
        str | None, typer.Option(metavar="AXIS", help="Axis that is up in the file: x, y or z.")
    ] = None,
    scale: Annotated[float, real_option("Additional scale factor.", metavar="S")] = 1.0,
    origin: Annotated[
        str,
        typer.Option(
            metavar="X,Y,Z",
            help="Point of the file that becomes the origin, metres, z up; auto: near the content "
            "where that is more than 10 km away, as in coordinates of maps.",
        ),
    ] = "auto",
    materials: Annotated[
        Path | None,
        typer.Option(metavar="YAML", help="Lines of `name in the file: material of spisim`."),
    ] = None,
    model_path: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="Folder to search for models, and to read from."),
    ] = None,
    ground: Annotated[
        str | None,
        typer.Option(metavar="MATERIAL", help="Add a floor of this material under everything."),
    ] = None,
    textures: Annotated[
        Textures,
        typer.Option(
            help="Pictures as reflectances, by a rule of thumb: their mean, the whole picture "
            "(glTF, OBJ, COLLADA), or not at all."
        ),
    ] = "mean",
    lamps: Annotated[
        Lamps,
        typer.Option(
            help="Lamps, other than sun and sky: left out, or their numbers, which have no unit, "
            "as watts within the instrument's band."
        ),
    ] = "off",
    surfaces: Annotated[
        Surfaces,
        typer.Option(
            help="Materials guessed for 1550 nm, or as the file has them in its own light, red "
            "(Mitsuba, glTF, OpenUSD, Gazebo)."
        ),
    ] = "guess",
    drone: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Where the drone is, metres, z up, from the new origin where --origin moves it.",
        ),
    ] = None,
    look_at: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="What it looks at, metres, z up, as --drone."),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Convert a file of another program to an editable scene file with meshes beside it."""
    from spisim_formats import Options, import_scene

    options = Options(
        units,
        up,
        scale,
        materials,
        (*(model_path or ()), *_search_path()),
        _fuel_cache(),
        ground,
        textures,
        lamps,
        surfaces,
        None if drone is None else _point("--drone", drone),
        None if look_at is None else _point("--look-at", look_at),
        overwrite,
        "auto" if origin == "auto" else _point("--origin", origin),
    )
    report = import_scene(file, output, options)
    warn(report.warnings)
    if json:
        print_json(_summary(report))
    else:
        _print(report)


def _point(option: str, text: str) -> tuple[float, float, float]:

    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise InputError(f"{option}: expected three numbers X,Y,Z; found {text!r}") from None
    return x, y, z


def _search_path() -> list[Path]:
    """Return the existing folders of Gazebo's environment variables."""
    listed = (os.environ.get(name, "").split(os.pathsep) for name in SEARCH_PATHS)
    return [Path(name) for names in listed for name in names if name and Path(name).is_dir()]


def _fuel_cache() -> Path | None:
    """Return Gazebo's folder of downloaded models, if it exists."""
    folder = Path(os.environ.get("GZ_FUEL_CACHE_PATH") or home() / ".gz" / "fuel")
    return folder if folder.is_dir() else None


def _summary(report: Import) -> dict[str, Any]:
    scene = report.written.scene
    drone = report.drone
    return {
        "written": [report.written.scene_file, *report.written.mesh_files],
        "objects": len(scene.objects),
        "triangles": report.triangles,
        "bounds_m": report.bounds_m.tolist(),
        "unit_m": report.unit_m,
        "unit_why": report.unit_why,
        "up": report.up,
        "up_why": report.up_why,
        "origin_m": report.origin_m.tolist(),
        "materials": [{**vars(match), "parts": parts} for match, parts in report.materials],
        "drone": {
            **vars(drone),
            "position_m": drone.position_m.tolist(),
            "look_at_m": drone.look_at_m.tolist(),
        },
        "notes": report.notes,
        "warnings": report.warnings,
    }


def _print(report: Import) -> None:
    size = report.bounds_m[1] - report.bounds_m[0]
    drone = report.drone
    lines = {
        "objects": f"{len(report.written.scene.objects)}, {report.triangles:,} triangles",
        "size": f"{_metres(size)} m, from {_metres(report.bounds_m[0])} "
        f"to {_metres(report.bounds_m[1])}",
        "unit": f"{report.unit_m:g} m ({report.unit_why})",
        "up": f"{report.up} ({report.up_why})",
        "drone": f"at {_metres(drone.position_m)}, looks at {_metres(drone.look_at_m)} "
        f"({drone.why}); nearest surface {drone.nearest_m:.2f} m, "
        + (f"ahead {drone.ahead_m:.2f} m" if math.isfinite(drone.ahead_m) else "nothing ahead"),
    }
    if report.origin_m.any():
        place = ", ".join(f"{value:.12g}" for value in report.origin_m)
        lines["origin"] = f"{place} m in the file (--origin); --drone and --look-at count from it"
    for title, text in lines.items():
        results.print(f"{title:8} {text}", soft_wrap=True)
    table = word_table("in the file", "material", "how", "why", "parts")
    for match, parts in report.materials:
        table.add_row(match.source, match.material, match.how, match.why, str(parts))
    results.print()
    print_table(table)
    results.print()
    for note in report.notes:
        results.print(f"note: {note}", soft_wrap=True)
    written = report.written
    say(
        f"Wrote {written.scene_file} and {len(written.mesh_files)} files beside it. "
        f"Look at it: spisim scenes show {shlex.quote(str(written.scene_file))}"
    )


def _metres(values: Any) -> str:
    return ", ".join(f"{value:.4g}" for value in values)
