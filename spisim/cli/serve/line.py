"""The link for frames, and back for commands."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

from reconstruction.base.errors import InputError

from ..console import say

if TYPE_CHECKING:
    from spisim.serving import Line


def line_to(
    to: str,
    commands: str | None,
    read: list[Path],
    *,
    steered: bool,
    lockstep: bool,
    overwrite: bool,
) -> Line:
    """Open the link, and check that it is available; commands come back if it allows."""
    from reconstruction.base.files import Output, require_outputs
    from reconstruction.live.framing import MAGIC
    from reconstruction.live.links import NewFile, Source, is_link, outlet_to, source_at
    from spisim.serving import Line

    outlet = outlet_to(to)
    if isinstance(outlet, NewFile):
        file = Output(Path(to), "stream", (".stream",), MAGIC.decode())
        require_outputs([file], read, overwrite=overwrite)
    source: Source | None = None
    if commands is not None:
        source = source_at(commands)
    elif isinstance(outlet, Source):
        source = outlet
    elif to == "-" and (steered or lockstep):
        source = source_at("-")
    if source is None and lockstep:
        raise InputError(f"--lockstep needs commands, and {to} cannot receive any: use --commands")
    lasting = to != "-" and is_link(to)
    return Line(outlet, source, lasting=lasting, say=say, wait=time.sleep)
