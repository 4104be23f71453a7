"""`spisim picture`: what a camera at the instrument's wavelength would see."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from . import options as opt
from .console import print_json, say
from .inputs import instrument_with, scene_with
from .outputs import beside, files_read
from .outputs import output as named
from .weather_options import OWN_WEATHER, Weather

EXAMPLE = "spisim picture warehouse -o warehouse.exr --fov 50 --clear"

#: Limit per file.
BYTES_PER_PIXEL = 4


class Camera(Enum):
    """Position of the camera."""

    PROJECTOR = "projector"
    DETECTOR = "detector"


@opt.with_options
def command(
    scene: opt.SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="EXR", help="OpenEXR file.")],
    instrument: opt.InstrumentOption = "paper",
    wavelength: opt.Wavelength = None,
    weather: Weather = OWN_WEATHER,
    camera: Annotated[
        Camera, typer.Option("--from", help="Position of the camera.")
    ] = Camera.PROJECTOR,
    width: Annotated[int, opt.number_option(1, 8192, "Pixels across.")] = 512,
    height: Annotated[int, opt.number_option(1, 8192, "Pixels down.")] = 512,
    fov: Annotated[
        float | None,
        opt.real_option(
            "Full angle across; by default the projector's.",
            minimum=0.1,
            maximum=170,
            metavar="DEG",
        ),
    ] = None,
    pattern: Annotated[
        int | None, opt.number_option(0, 2**31, "Exposure whose pattern is lit; by default all on.")
    ] = None,
    spp: Annotated[int, opt.number_option(1, 2**20, "Light paths per pixel.")] = 64,
    seed: opt.Seed = 0,
    overwrite: opt.Overwrite = False,
    json: opt.Json = False,
) -> None:
    """Render radiance, W m⁻² sr⁻¹ in the filter's band: projector, sun and sky, through the fog.

    Writes an OpenEXR file, and a tone-mapped PNG beside it.
    """
    from reconstruction import InputError
    from reconstruction.base.folders import output_files
    from reconstruction.operators import illumination
    from spisim.base.exr import write_exr
    from spisim.transport import CAMERA_OFFSET_M, camera_view
    from spisim_app.report.pictures import view_scale, write_png

    size_bytes = BYTES_PER_PIXEL * width * height
    files = [named(output, "radiance", size_bytes), beside(output, "picture", size_bytes)]
    with output_files(files, files_read(scene, instrument), overwrite=overwrite):
        picture = files[1].path
        carried = instrument_with(instrument, wavelength)
        there, oddities = scene_with(scene, carried.wavelength_nm, weather)
        plan = carried.pattern_plan
        if pattern is not None and pattern >= plan.exposures:
            raise InputError(f"--pattern {pattern}: the plan has exposures 0..{plan.exposures - 1}")
        above = (0.0, -CAMERA_OFFSET_M, 0.0)
        view = camera_view(
            there,
            carried,
            width=width,
            height=height,
            fov_deg=fov,
            pattern=None if pattern is None else illumination(plan, pattern),
            position_m=above
            if camera is Camera.PROJECTOR
            else carried.imaging.detector.positions_m[0],
            spp=spp,
            seed=seed,
        )
        attributes = {"units.radiance": "W m^-2 sr^-1", "scene": there.name}
        write_exr(output, "radiance", {"radiance": view}, attributes)
        write_png(picture, view_scale(view).rgba(view))
        if json:
            mean = float(view.mean())
            print_json({"written": [output, picture], "warnings": oddities, "radiance_mean": mean})
        else:
            say(f"Wrote {output} and {picture}.")
