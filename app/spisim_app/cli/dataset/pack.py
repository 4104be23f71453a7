"""`spisim dataset pack`: pack the arrays of a data set for fast training."""

from pathlib import Path
from typing import Annotated

import typer

from ..console import print_json, progress_bar, say
from ..options import Bar, Json
from .running import Folder

EXAMPLE = "spisim dataset pack out/fog -o fog-pack --array buckets --array depth_m.anchored"


def command(
    folder: Folder,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of the pack.")
    ],
    array: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="An array to pack, as often as needed; by default all recorded."
        ),
    ] = None,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Verify every capture, and write its arrays for `spisim.open_dataset` to map into memory."""
    from spisim.dataset import open as open_dataset
    from spisim.dataset import pack_dataset

    data = open_dataset(folder)
    with progress_bar("Packing", progress) as advance:
        packed = pack_dataset(data, output, array or (), advance)
    assert packed.pack is not None
    arrays = packed.pack.index.arrays
    size_bytes = sum(entry.bytes for entry in arrays.values())
    if json:
        print_json({"samples": len(packed), "arrays": list(arrays), "bytes": size_bytes})
    else:
        say(f"Packed {len(packed)} samples, {size_bytes / 1e6:.3g} MB: {', '.join(arrays)}")
