"""`spisim schema`: JSON Schema of the configuration files."""

from enum import StrEnum
from typing import Annotated, Any

import typer

from .console import print_json

EXAMPLE = "spisim schema instrument > instrument.schema.json"


class Kind(StrEnum):
    """A kind of configuration file."""

    scene = "scene"
    instrument = "instrument"
    plan = "plan"
    study = "study"


def command(kind: Annotated[Kind, typer.Argument(help="Which file.", show_default=False)]) -> None:
    """Print the JSON Schema of a kind of YAML file, for editors that validate while typing."""
    from pydantic import TypeAdapter

    print_json(TypeAdapter(_model(kind)).json_schema())


def _model(kind: Kind) -> Any:
    """Return the pydantic type of a kind of file."""
    match kind:
        case Kind.scene:
            from spisim.scene.description import DrawnDescription, SceneDescription

            return SceneDescription | DrawnDescription
        case Kind.instrument:
            from spisim.instrument import Instrument

            return Instrument
        case Kind.plan:
            from spisim.dataset.plan import Plan

            return Plan
        case Kind.study:
            from spisim.dataset.study.plan import StudyPlan

            return StudyPlan
