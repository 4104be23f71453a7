"""`spisim dataset export`: samples for programs that do not read data sets."""

from pathlib import Path
from typing import Annotated

import typer

from ..console import messages, print_json, results
from ..options import Json, number_option
from .running import Folder

EXAMPLE = "spisim dataset export out/fog -o shards --shard-size 500"


def _list(wanted: bool) -> None:
    if wanted:
        from spisim.dataset import EXPORTS

        results.print("\n".join(EXPORTS))
        raise typer.Exit


def command(
    folder: Folder,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the files.")
    ],
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help="webdataset: TAR files with captures and parameters; rgbd, nerf, pcd: images, "
            "true depth and poses of each scene; coco: all images and an index.",
        ),
    ] = "webdataset",
    formats: Annotated[
        bool, typer.Option("--formats", callback=_list, is_eager=True, help="List all formats.")
    ] = False,
    shard_size: Annotated[
        int, number_option(1, 10**6, "Samples per shard, if the format has shards.")
    ] = 1000,
    json: Json = False,
) -> None:
    """Write the finished samples in another format; shards can be streamed.

    Equal data sets give byte-equal files.
    """
    from spisim.dataset import EXPORTS
    from spisim.dataset import open as open_data_set

    write = EXPORTS[form]
    data = open_data_set(folder)
    written = write(data, output, shard_size)
    if json:
        print_json({"written": written, "samples": len(data)})
    else:
        messages.print(f"Wrote {len(data)} samples to {len(written)} files in {output}.")
