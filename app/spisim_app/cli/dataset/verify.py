"""`spisim dataset verify`: verify that all files are as written."""

import typer

from ..console import messages, print_json, progress_bar, say, warn
from ..options import Bar, Json
from ..tables import plain_table, print_table
from .running import Folder

EXAMPLE = "spisim dataset verify out/fog"


def command(folder: Folder, json: Json = False, progress: Bar = None) -> None:
    """Read all files and compare them with the manifest; exit status 1 if anything is wrong.

    Reports files that are missing, damaged, of another plan, or not in the manifest.
    """
    from dataclasses import asdict

    from reconstruction.base.folders import holder
    from spisim.dataset.folder import Layout
    from spisim.dataset.verify import verify

    runner = holder(Layout(folder).lock)
    if runner:
        warn([f"process {runner} is making samples; its latest may appear as extra or unfinished"])
    with progress_bar("Reading", progress) as advance:
        findings = verify(folder, advance)
    if json:
        print_json({"sound": not findings, "findings": [asdict(each) for each in findings]})
    elif findings:
        table = plain_table("file", "problem", "what")
        for each in findings:
            table.add_row(each.file, each.problem, each.detail)
        print_table(table)
        messages.print(f"{len(findings)} files have problems.")
    else:
        say(f"All files of {folder} are as they were written.")
    if findings:
        raise typer.Exit(1)
