"""`spisim instrument new`: an instrument file from data sheets."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from reconstruction.base.errors import InputError
from reconstruction.base.files import Output, write_atomically
from reconstruction.base.folders import output_files

from .. import budget
from ..console import say
from ..options import Json, Overwrite
from ..outputs import output as named
from .data_sheet import QUESTIONS, completed, default_of, is_asked

EXAMPLE = "spisim instrument new -o mine.yaml --makes image --array-power-w 2 --defaults"


def _option(name: str) -> Any:
    """Return the option of a question; its value is checked with all others."""
    question = QUESTIONS[name]
    return typer.Option(
        f"--{name.replace('_', '-')}",
        metavar=name.rpartition("_")[2].upper(),
        help=question.text,
        show_default=f"{question.default:g}"
        if isinstance(question.default, float)
        else str(question.default),
    )


def command(
    context: typer.Context,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="YAML", help="File to write.")],
    makes: Annotated[str | None, _option("makes")] = None,
    wavelength_nm: Annotated[str | None, _option("wavelength_nm")] = None,
    filter_width_nm: Annotated[str | None, _option("filter_width_nm")] = None,
    pixels: Annotated[str | None, _option("pixels")] = None,
    field_deg: Annotated[str | None, _option("field_deg")] = None,
    array_power_w: Annotated[str | None, _option("array_power_w")] = None,
    array_fwhm_nm: Annotated[str | None, _option("array_fwhm_nm")] = None,
    pattern_rate_hz: Annotated[str | None, _option("pattern_rate_hz")] = None,
    patterns: Annotated[str | None, _option("patterns")] = None,
    image_part: Annotated[str | None, _option("image_part")] = None,
    image_adc_bits: Annotated[str | None, _option("image_adc_bits")] = None,
    spots: Annotated[str | None, _option("spots")] = None,
    laser_power_w: Annotated[str | None, _option("laser_power_w")] = None,
    modulation: Annotated[str | None, _option("modulation")] = None,
    frequency_hz: Annotated[str | None, _option("frequency_hz")] = None,
    pulse_s: Annotated[str | None, _option("pulse_s")] = None,
    frame_time_s: Annotated[str | None, _option("frame_time_s")] = None,
    range_part: Annotated[str | None, _option("range_part")] = None,
    range_adc_bits: Annotated[str | None, _option("range_adc_bits")] = None,
    defaults: Annotated[
        bool, typer.Option("--defaults", help="Ask nothing: use defaults where no option is given.")
    ] = False,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Write an instrument file from data sheets, and its budget beside it.

    Without --defaults, it asks on a terminal for whatever no option gives.
    """
    from .full_scale import new_instrument_text

    given = {name: context.params[name] for name in QUESTIONS}
    picture = output.with_suffix(".png")
    files = [Output(output, "instrument file", (".yaml", ".yml")), named(picture, "budget")]
    if output.exists() and not overwrite:
        raise InputError(f"{output} exists; --overwrite replaces it")
    with output_files(files[:1], overwrite=True), output_files(files[1:], overwrite=overwrite):
        if not defaults and not json and sys.stdin.isatty():
            given = _asked(given)
        text = new_instrument_text(completed(given), str(output))
        write_atomically(output, text.encode())
        say(f"Wrote {output}.")
        budget.command(str(output), output=picture, overwrite=overwrite, json=json)


def _asked(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return answers to all questions, from options or from the user."""
    answers: dict[str, Any] = {}
    for name, question in QUESTIONS.items():
        if not is_asked(name, answers):
            if given[name] is not None:
                answers[name] = given[name]  # rejected later with all others
            continue
        answers[name] = given[name]
        while answers[name] is None:
            answer = typer.prompt(
                f"{question.text} ({name})", default=default_of(name, answers), type=str, err=True
            )
            try:
                answers[name] = question.checked(name, answer)
            except InputError as error:
                say(f"{error}", style="red")
        answers[name] = question.checked(name, answers[name])
    return answers
