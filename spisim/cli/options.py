"""Options shared by several commands."""

from contextlib import suppress
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any

import typer

from reconstruction.base.errors import InputError

from . import complete


def number_option(minimum: int, maximum: int, text: str, usual: int | None = None) -> Any:
    """Define an option for a whole number, with an error message that names the limits.

    `usual` is displayed as the default instead of None.
    """

    def parse(value: str) -> int:
        with suppress(ValueError):
            if minimum <= int(value) <= maximum:
                return int(value)
        raise typer.BadParameter(f"{value} is not a whole number from {minimum} to {maximum}")

    return typer.Option(parser=parse, metavar="N", help=text, show_default=str(usual or "") or True)


def real_option(
    text: str, *names: str, minimum: float = -inf, maximum: float = inf, metavar: str = "X"
) -> Any:
    """Define an option for a number, with an error message that names the limits."""
    limits = f" from {minimum:g} to {maximum:g}" if isfinite(maximum) else ""

    def parse(value: str) -> float:
        with suppress(ValueError):
            if minimum <= float(value) <= maximum:
                return float(value)
        raise typer.BadParameter(f"{value} is not a number{limits}")

    return typer.Option(*names, parser=parse, metavar=metavar, help=text)


def light_budget(spp: int | None, transport_noise_share: float | None) -> dict[str, Any]:
    """Return arguments for the light transport. Raises InputError if both are given."""
    if transport_noise_share is None:
        return {"spp": SPP if spp is None else spp}
    if spp is not None:
        raise InputError("--spp and --transport-noise-share exclude each other")
    return {"transport_noise_share": transport_noise_share}


SceneArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="A scene file, or the name of a shipped scene.",
        autocompletion=complete.scenes,
    ),
]
CaptureArgument = Annotated[
    Path, typer.Argument(metavar="CAPTURE", help="A capture file (HDF5).", show_default=False)
]
StatedWeather = Annotated[
    str | None,
    typer.Option(
        "--weather",
        metavar="WEATHER",
        help="Weather assumed for ranges: clear, fog, unknown, or a visibility in metres.",
    ),
]
FrameOption = Annotated[int, number_option(0, 2**31, "Frame of the capture.")]
MinFree = Annotated[
    float | None,
    typer.Option(
        metavar="P", help="An obstacle is where the corridor is free with a probability below P."
    ),
]
Methods = Annotated[
    str | None, typer.Option(metavar="METHOD[,METHOD]", help="Methods by name; usual, all.")
]
InstrumentOption = Annotated[
    str,
    typer.Option(
        "--instrument",
        help="An instrument file, or the name of a preset.",
        autocompletion=complete.instruments,
    ),
]
Seed = Annotated[int, number_option(0, 2**63 - 1, "Seed of all randomness.")]
Spp = Annotated[
    int, number_option(1, 2**20, "Light paths per virtual pixel; the error falls as 1/√spp.")
]
SPP = 256
#: For commands that accept the error of the light instead; see `light_budget`.
SppOrShare = Annotated[
    int | None,
    number_option(1, 2**20, "Light paths per virtual pixel; the error falls as 1/√spp.", SPP),
]
NoiseShare = Annotated[
    float | None,
    real_option(
        "Instead of --spp: trace until the light's standard error in coefficients and spots is at "
        "most this fraction of the detectors' noise.",
        "--transport-noise-share",
        minimum=1e-3,
        maximum=10,
    ),
]
Wavelength = Annotated[
    float | None,
    real_option(
        "The instrument moved to this wavelength, 850, 905, 940, 1460 or 1550: its filter "
        "and LEDs move along, powers and quantum efficiencies stay.",
        "--wavelength",
        metavar="NM",
    ),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace files that this command did not write, too.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Bar = Annotated[
    bool | None,
    typer.Option("--progress/--no-progress", help="Progress bar; by default on a terminal."),
]
