"""Commands as users call them, shared by the tests."""

import sys
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from spisim_app.cli import app


def spisim(*arguments: str | Path) -> Any:
    """Run a command in this process."""
    return CliRunner().invoke(app, list(map(str, arguments)), env={"COLUMNS": "100"})


def mistake(*arguments: str | Path) -> str:
    """What a command says about a user's mistake."""
    run = spisim(*arguments)
    assert run.exit_code == 2, run.stderr
    assert "Traceback" not in run.stderr
    assert run.stdout == ""
    return run.stderr


def program(*arguments: str | Path) -> list[str]:
    """The command line of a process of its own."""
    return [sys.executable, "-c", "from spisim_app.cli import main; main()", *map(str, arguments)]
