"""Progress of a flight, once a second, and its summary."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from spisim_app.cli.console import print_json, say

if TYPE_CHECKING:
    from spisim_serving.server import Server


def tell(server: Server) -> None:
    """Print the progress."""
    say("; ".join(_words(server)))


def _words(server: Server) -> list[str]:
    tally = server.tally
    words = [f"{tally.frames} frames, {server.time_s:.1f} s"]
    words += [f"{server.camera.lattice.solved} key poses"]
    if tally.late:
        words += [f"late {tally.late}, {tally.behind_s:.1f} s behind in all"]
    counts = {name: value for name, value in asdict(tally).items() if value}
    for name in ("repeated", "refused", "corrupted", "stops", "discarded_bytes"):
        if name in counts:
            words += [f"{name} {counts[name]}"]
    return words


def report(server: Server, written: list[Path], oddities: list[str], *, json: bool) -> None:
    """Print the summary."""
    if json:
        tally = asdict(server.tally) | {"key_poses": server.camera.lattice.solved}
        print_json({"written": written, "time_s": server.time_s, **tally, "warnings": oddities})
        return
    say(f"Sent {'; '.join(_words(server))}.")
    if written:
        say(f"Wrote {' and '.join(map(str, written))}.")
