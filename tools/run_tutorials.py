"""Run the notebooks of docs/tutorials again, and store what they show.

    python tools/run_tutorials.py [NAME ...] [--check]

Needs `pip install 'spisim[docs]'`. With `--check` nothing is stored.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "tutorials"
#: Seconds that a cell may take; on a busy machine, far more than it does.
PATIENCE_S = 600


def run(path: Path) -> nbformat.NotebookNode:
    """The notebook with its outputs, run in an empty folder. Raises where a cell does."""
    notebook = nbformat.read(path, as_version=4)
    os.environ["REPOSITORY"] = str(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook,
            timeout=PATIENCE_S,
            kernel_name="python3",
            resources={"metadata": {"path": folder}},
            record_timing=False,
            startup_timeout=PATIENCE_S,
        )
        client.execute()
    return _retained(notebook, folder)


def _retained(notebook: nbformat.NotebookNode, folder: str) -> nbformat.NotebookNode:
    """What is worth storing: no state of editors and kernels, no names of a passing folder."""
    notebook.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    for number, cell in enumerate(notebook.cells):
        cell.metadata = {}
        cell.id = f"cell-{number}"
        if cell.cell_type == "code":
            cell.outputs = [
                _without(folder, output) for output in cell.outputs if _displayed(output)
            ]
    return notebook


def _displayed(output: nbformat.NotebookNode) -> bool:
    return output.output_type != "stream" or output.name == "stdout"


def _without(folder: str, output: nbformat.NotebookNode) -> nbformat.NotebookNode:
    if output.output_type == "stream":
        output.text = output.text.replace(folder, "…")
    output.pop("metadata", None)
    if output.output_type != "stream":
        output.metadata = {}
    return output


def main() -> None:
    """Run those that are named, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="without .ipynb; all of them")
    parser.add_argument("--check", action="store_true", help="store nothing")
    options = parser.parse_args()
    names = options.names or sorted(path.stem for path in FOLDER.glob("*.ipynb"))
    for name in names:
        begin = time.monotonic()
        path = FOLDER / f"{name}.ipynb"
        notebook = run(path)
        if not options.check:
            nbformat.write(notebook, path)
        print(f"{name}: {time.monotonic() - begin:.0f} s, {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
