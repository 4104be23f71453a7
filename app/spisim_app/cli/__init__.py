"""The `spisim` command: one module for each of its subcommands."""

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from reconstruction.base.errors import InputError, explain
from reconstruction.base.registry import Registry
from reconstruction.base.text import flush_output, write_anything
from spisim.version import __version__

from . import (
    budget,
    dataset,
    demo,
    doctor,
    evaluate,
    export,
    fly,
    instrument,
    materials,
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
from .console import fail, warn
from .outputs import INTERRUPTED


class Commands(TyperGroup):
    """The subcommands; errors caused by the user end in a message, never in a traceback."""

    as_json = False

    def make_context(self, info_name: Any, args: Any, *more: Any, **options: Any) -> Any:
        """Parse the arguments before the subcommand."""
        self.as_json = "--json" in args
        with _report_errors(self.as_json):
            return super().make_context(info_name, args, *more, **options)

    def invoke(self, ctx: Any) -> Any:
        """Run a subcommand: exit 2 for unusable input or files, 130 for Ctrl-C."""
        with _report_errors(self.as_json):
            return super().invoke(ctx)


@contextmanager
def _report_errors(as_json: bool) -> Iterator[None]:
    """Report errors caused by the user in one line, and exit."""
    try:
        yield
        flush_output()
    except BrokenPipeError:
        raise
    except OSError as error:
        message, status = explain(error), 2
    except InputError as error:
        message, status = str(error), 2
    except KeyboardInterrupt as error:
        message, status = str(error) or INTERRUPTED, 130
    except Exception as error:
        if _is_interrupt(error):
            message, status = INTERRUPTED, 130
        elif (wrong := _wrong_arguments(error)) is None:
            raise
        else:
            message, status = wrong, 2
    else:
        return
    fail(message, status, as_json)
    raise typer.Exit(status)


def _is_interrupt(error: BaseException) -> bool:
    """Return whether an exception is Ctrl-C raised by a C++ library, as Mitsuba does on import."""
    cause = error.__cause__ or error.__context__
    return isinstance(error, SystemError | ImportError) and isinstance(cause, KeyboardInterrupt)


def _wrong_arguments(error: Any) -> str | None:
    """Return a message on wrong arguments and where their help is; None for other errors.

    Typer's errors have a context; a command called without arguments shows its help as one of them.
    """
    if not hasattr(error, "format_message") or type(error).__name__ == "NoArgsIsHelpError":
        return None
    context = getattr(error, "ctx", None)
    where = "" if context is None else f" ({context.command_path} --help)"
    message = error.format_message().replace(": Value error, ", ": ")  # of a choice
    return f"{message}{where}"


app = typer.Typer(
    cls=Commands,
    name="spisim",
    help="Single-pixel imaging with laser spots: simulate, reconstruct, evaluate.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _tell_version(wanted: bool) -> None:
    if wanted:
        print(f"spisim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_tell_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Options of the program itself."""


OWN = (
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
    weather,
    materials,
    schema,
    doctor,
)

OTHERS: Registry[Mapping[str, Any]] = Registry(
    "command", attribute="COMMANDS", group="spisim.commands"
)
"""Modules by their words, of packages that add some."""

COMMANDS = {each.__name__.rpartition(".")[2]: each for each in OWN}
for _, commands in OTHERS.loadable():
    COMMANDS |= commands
for name, module in COMMANDS.items():
    app.command(name, epilog=f"Example: {module.EXAMPLE}")(module.command)

app.add_typer(dataset.app)
app.add_typer(instrument.app)
app.add_typer(scenes.app)


def main() -> None:
    """Entry point of the console script."""
    write_anything()
    warnings.showwarning = lambda message, *_: warn([str(message)])
    app()
