"""The link for frames, and back for commands."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reconstruction.base.errors import InputError
from spisim_app.cli.console import say

if TYPE_CHECKING:
    from reconstruction.base.files import Output
    from spisim_serving.line import Line


@dataclass(frozen=True)
class LinkOptions:
    """Where frames go and commands come from."""

    to: Annotated[
        str,
        typer.Option(
            metavar="OUTLET",
            help="tcp-listen://HOST:PORT, tcp://, udp://, serial://, - (a pipe) or FILE.stream.",
        ),
    ] = "tcp-listen://127.0.0.1:5800"
    commands: Annotated[
        str | None,
        typer.Option(metavar="SOURCE", help="Where commands come from, if not from there too."),
    ] = None
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="A frame for each command, however long it takes.")
    ] = False

    @property
    def outputs(self) -> list[Output]:
        """The file of frames, if it is one."""
        from spisim_live.links import NewFile, is_link

        return [] if is_link(self.to) else [NewFile(Path(self.to)).output]

    @property
    def read(self) -> list[Path]:
        """The file of commands, if it is one."""
        return [] if self.commands is None else [Path(self.commands)]

    def line(self, *, steered: bool) -> Line:
        """The line; InputError if its ends cannot be used, or lockstep lacks commands."""
        from spisim_live.links import Source, is_link, outlet_to, source_at
        from spisim_serving.line import Line

        outlet = outlet_to(self.to)
        source: Source | None = None
        if self.commands is not None:
            source = source_at(self.commands)
        elif isinstance(outlet, Source):
            source = outlet
        elif self.to == "-" and (steered or self.lockstep):
            source = source_at("-")
        if source is None and self.lockstep:
            raise InputError(f"--lockstep needs commands, and {self.to} has none: add --commands")
        lasting = self.to != "-" and is_link(self.to)
        return Line(outlet, source, lasting=lasting, say=say, wait=time.sleep)


SOCKET = LinkOptions()
