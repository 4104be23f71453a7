"""`spisim transport`: the returning light, before any detector."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from . import options as opt
from .console import print_json, progress_bar, say
from .inputs import instrument_with, scene_with
from .outputs import beside, files_read
from .outputs import output as named
from .weather_options import OWN_WEATHER, Weather

EXAMPLE = "spisim transport warehouse -o warehouse.exr --transport-noise-share 0.1 --frequency 15e6"


@opt.with_options
def command(
    scene: opt.SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="EXR", help="OpenEXR file.")],
    instrument: opt.InstrumentOption = "paper",
    wavelength: opt.Wavelength = None,
    weather: Weather = OWN_WEATHER,
    seed: opt.Seed = 0,
    light: opt.LightBudget = opt.TRACED,
    frequency: Annotated[
        list[float] | None,
        opt.real_option(
            "Add the phasor image at this frequency.", minimum=0, maximum=1e12, metavar="HZ"
        ),
    ] = None,
    orders: Annotated[
        bool,
        typer.Option(
            "--orders",
            help="Also write unscattered, singly and multiply scattered light separately.",
        ),
    ] = False,
    cube: Annotated[
        float | None,
        opt.real_option(
            "Add every pixel's light over path length to the .npz, in bins of M metres.",
            minimum=0.01,
            maximum=10,
            metavar="M",
        ),
    ] = None,
    sensitivity: Annotated[
        list[str] | None,
        typer.Option(
            "--sensitivity",
            metavar="NAME",
            help="Add derivatives by parameters, with commas between: scene.fog.visibility_m, "
            "materials.concrete, drone.forward_m.",
        ),
    ] = None,
    also_visibility: Annotated[
        list[float] | None,
        opt.real_option(
            "Add the light in the same fog of another visibility, from the same paths.",
            "--also-visibility",
            minimum=0.1,
            maximum=1e6,
            metavar="M",
        ),
    ] = None,
    overwrite: opt.Overwrite = False,
    json: opt.Json = False,
    progress: opt.Bar = None,
) -> None:
    """Trace the light only: transport image and truth as channels of an OpenEXR file.

    The spots' light over path length goes into a NumPy file (.npz) beside it, as does the cube
    (rows, columns, bins), whose last bin collects paths longer than 80 m, and the derivatives of
    the spots' and of steady light. `units.*` in either file are the units.
    """
    from reconstruction.base.folders import output_files
    from spisim.simulation.light import NEAR_PATH_M
    from spisim.simulation.light.displacement import displacements, is_coordinate, require_known
    from spisim.simulation.light.files import (
        derived_channels,
        light_channels,
        write_histograms,
        write_truth,
    )
    from spisim.simulation.light.other_fog import OtherFog
    from spisim.simulation.light.sensitivity import sensitivities, weights_of
    from spisim.simulation.light.solve import solve_fogs
    from spisim.transport import Outputs, PathLengthBins, ground_truth

    files = [named(output, "transport image"), beside(output, "histograms")]
    with output_files(files, files_read(scene, instrument), overwrite=overwrite):
        histograms = files[1].path
        carried = instrument_with(instrument, wavelength)
        loaded, oddities = scene_with(scene, carried.wavelength_nm, weather)
        names = _names(sensitivity or ())
        coordinates = list(filter(is_coordinate, names))
        require_known(loaded, coordinates)
        derivatives = sensitivities(loaded, [name for name in names if name not in coordinates])
        fogs = [OtherFog.of_visibility(loaded, each) for each in also_visibility or ()]
        outputs = Outputs(
            orders=orders,
            frequencies_hz=tuple(frequency or ()),
            bins=None if cube is None else PathLengthBins.up_to(NEAR_PATH_M, cube),
            weights=weights_of(derivatives),
        )
        with progress_bar("Tracing light", progress) as advance:
            traced, *rest = solve_fogs(
                loaded,
                carried,
                fogs,
                **light.arguments,
                seed=seed,
                outputs=outputs,
                progress=advance,
            )
        spp = light.arguments.get("spp", opt.SPP)
        with progress_bar("Moving", progress) as advance:
            derivatives += displacements(
                loaded, carried, coordinates, traced, spp=spp, seed=seed, progress=advance
            )
        others = dict(zip(also_visibility or (), rest, strict=True))
        fractions = {each: other.reweighted.require_carried() for each, other in others.items()}
        channels = light_channels(traced, frequency or ())
        channels |= derived_channels(traced, derivatives, others)
        units = {
            f"transport_per.{each.parameter}{ending}": each.unit
            for each in derivatives
            for ending in ("", "_error")
        }
        write_truth(output, ground_truth(loaded, carried), channels, units)
        write_histograms(histograms, traced, derivatives, others)
    if json:
        print_json(
            {
                "written": [output, histograms],
                "warnings": oddities,
                "paths": traced.paths,
                "seconds": traced.seconds,
                "transport_mean": float(traced.image.mean()),
                "sensitivities": {
                    each.parameter: float(each.of(traced)[0].mean()) for each in derivatives
                },
                "paths_that_carry": {f"{each:g} m": own for each, own in fractions.items()},
            }
        )
    else:
        say(f"Wrote {output} and {histograms}: {traced.paths:,} paths in {traced.seconds:.1f} s.")


def _names(lists: Sequence[str]) -> list[str]:
    """All names, in order and each once."""
    return list(dict.fromkeys(name.strip() for names in lists for name in names.split(",")))
