"""`spisim dataset export`: samples for programs that do not read this folder."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from ..console import messages, print_json
from ..options import Json, number_option
from .arguments import Folder

EXAMPLE = "spisim dataset export out/fog -o shards --shard-size 500"


def command(
    folder: Folder,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the shards.")
    ],
    form: Annotated[
        Literal["webdataset"],
        typer.Option("--format", help="TAR files with captures (.h5) and parameters (.json)."),
    ] = "webdataset",
    shard_size: Annotated[int, number_option(1, 10**6, "Samples in each shard.")] = 1000,
    json: Json = False,
) -> None:
    """Write the finished samples as shards, which are read as one stream.

    Equal data sets give byte-equal shards.
    """
    from spisim.dataset import open as open_data_set
    from spisim.dataset import write_shards

    data = open_data_set(folder)
    written = write_shards(data, output, shard_size)
    if json:
        print_json({"written": written, "samples": len(data)})
    else:
        messages.print(f"Wrote {len(data)} samples to {len(written)} shards in {output}.")
