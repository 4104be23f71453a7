"""Options that several commands share, and groups of options as parameters of a command."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, signature
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

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
    limits = limits or (f" of at least {minimum:g}" if isfinite(minimum) else "")

    def parse(value: str) -> float:
        with suppress(ValueError):
            if minimum <= float(value) <= maximum:
                return float(value)
        raise typer.BadParameter(f"{value} is not a number{limits}")

    return typer.Option(*names, parser=parse, metavar=metavar, help=text)


def with_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command as Typer reads it: each parameter that is a data class becomes its options."""
    hints = get_type_hints(command)
    groups: dict[str, Any] = {name: each for name, each in hints.items() if is_dataclass(each)}
    options = {name: _options(kind) for name, kind in groups.items()}

    @wraps(command)
    def grouped(**given: Any) -> None:
        made = {
            name: kind(**{option: given.pop(option) for option in options[name]})
            for name, kind in groups.items()
        }
        command(**made, **given)

    parameters: list[Parameter] = []
    for name, parameter in signature(command, eval_str=True).parameters.items():
        parameters += options[name].values() if name in options else [parameter]
    whole = signature(command).replace(parameters=parameters)
    grouped.__signature__ = whole  # type: ignore[attr-defined]
    grouped.__annotations__ = {each.name: each.annotation for each in parameters}
    return grouped


def _options(kind: Any) -> dict[str, Parameter]:
    """The fields of a data class that are options, as parameters."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        field.name: Parameter(
            field.name,
            Parameter.POSITIONAL_OR_KEYWORD,
            default=field.default,
            annotation=hints[field.name],
        )
        for field in fields(kind)
        if hasattr(hints[field.name], "__metadata__")
    }


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
#: For commands that accept the light's error instead; see `LightBudget`.
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


@dataclass(frozen=True)
class LightBudget:
    """How much light is traced: a number of paths, or as many as an error asks for."""

    spp: SppOrShare = None
    transport_noise_share: NoiseShare = None

    def __post_init__(self) -> None:
        """InputError if both are given."""
        if self.spp is not None and self.transport_noise_share is not None:
            raise InputError("--spp and --transport-noise-share exclude each other")

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of a light transport."""
        if self.transport_noise_share is not None:
            return {"transport_noise_share": self.transport_noise_share}
        return {"spp": SPP if self.spp is None else self.spp}


@dataclass(frozen=True)
class LightOptions(LightBudget):
    """Light that is traced, or a fast surrogate of it."""

    light: Annotated[
        Literal["traced", "surrogate"],
        typer.Option(help="surrogate: a fast stand-in, to learn from."),
    ] = "traced"

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of a simulation."""
        return super().arguments | {"light": self.light}


@dataclass(frozen=True)
class RunOptions:
    """How a command treats existing files, and what it prints."""

    overwrite: Overwrite = False
    json: Json = False
    progress: Bar = None


TRACED = LightBudget()
TRACED_OR_SURROGATE = LightOptions()
RUN = RunOptions()
