"""The `spisim` command: one module for each of its subcommands."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer
from typer.core import TyperGroup

from reconstruction.errors import InputError, explain
from reconstruction.text import printable, write_anything

from . import (
    budget,
    dataset,
    demo,
    doctor,
    evaluate,
    export,
    fly,
    paper,
    picture,
    reconstruct,
    scenes,
    schema,
    simulate,
    study,
    transport,
    view,
    weather,
)
from .console import say, warn


@contextmanager
def _shown_as_they_are() -> Iterator[None]:
    """What is said of wrong arguments steers no terminal."""
    try:
        yield
    except Exception as error:
        if hasattr(error, "format_message"):
            error.message = printable(error.message)  # type: ignore[attr-defined]
        raise


class Commands(TyperGroup):
    """The subcommands; what a user can cause ends as a message, never as a traceback."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Read the arguments up to the subcommand."""
        with _shown_as_they_are():
            return super().make_context(*arguments, **options)

    def invoke(self, ctx: Any) -> Any:
        """Run a subcommand: exit 2 for input or files that cannot be used, 130 for Ctrl-C."""
        try:
            with _shown_as_they_are():
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
    export,
    view,
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
    write_anything()
    warnings.showwarning = lambda message, *_: warn([str(message)])
    app()
