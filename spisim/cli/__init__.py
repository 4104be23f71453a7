"""The `spisim` command: one module for each of its subcommands."""

import warnings
from typing import Any

import typer
from typer.core import TyperGroup

from reconstruction.errors import InputError, explain

from . import (
    budget,
    dataset,
    demo,
    doctor,
    evaluate,
    fly,
    paper,
    picture,
    reconstruct,
    scenes,
    schema,
    simulate,
    study,
    transport,
    weather,
)
from .console import say, warn


class Commands(TyperGroup):
    """The subcommands; what a user can cause ends as a message, never as a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run a subcommand: exit 2 for input or files that cannot be used, 130 for Ctrl-C."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            raise
        except OSError as error:
            message, status = explain(error), 2
        except ValueError as error:
            if not isinstance(error, InputError):
                raise
            message, status = str(error), 2
        except KeyboardInterrupt:
            message, status = "interrupted; no file is left half-written", 130
        say(f"error: {message}", style="red")
        raise typer.Exit(status)


app = typer.Typer(
    cls=Commands,
    name="spisim",
    help="Single-pixel imaging with four laser spots: simulate, reconstruct, evaluate.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

COMMANDS = (
    demo,
    simulate,
    transport,
    picture,
    reconstruct,
    evaluate,
    fly,
    study,
    budget,
    paper,
    weather,
    schema,
    doctor,
)

for module in COMMANDS:
    name = module.__name__.rpartition(".")[2]
    app.command(name, epilog=f"Example: {module.EXAMPLE}")(module.command)

app.add_typer(dataset.app)
app.add_typer(scenes.app)


def main() -> None:
    """Entry point of the console script."""
    warnings.showwarning = lambda message, *_: warn([str(message)])
    app()
