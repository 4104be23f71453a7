"""Rows of the tables of bad inputs in `tests/data/bad_inputs`, and what each of them must not do.

A line has a command and, after a bar, words of the message that it ends with. `\\x1b` and the like
stand for characters. In place of a command a line may change a good file first: "scene: path =
value" (a YAML value; none at all takes the field out), "scene text: ..." replaces all of it.
"""

import hashlib
import io
import re
import resource
import shlex
import signal
import stat
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import yaml
from typer.main import get_command

from desk import FLIGHT, PLAN, STUDY
from reconstruction.cli import main as rig
from scenefiles import MINIMAL
from spisim.instrument.model import PRESETS
from spisim_app.cli import app
from waiting import SAFETY_S

#: The commands, made once.
SPISIM = get_command(app)
TABLES = Path(__file__).parent / "data" / "bad_inputs"
#: Of processor time: a command that takes longer hangs, as does one that waits for `SAFETY_S`.
SECONDS = 20
MEMORY_BYTES = 3 * 2**30
#: What a message has no business with.
INSIDES = re.compile(
    r"Traceback|index out of range|has no attribute|NoneType|AssertionError|KeyError|TypeError"
    r"|ValueError|<class|Errno|object at 0x|\.py\b|positional argument|unhashable type|numpy\.|np\."
    r"|not subscriptable|codec can't|invalid literal|could not convert|must be str|unpack"
    r"|pydantic|jinja|h5py|yaml\.(?!org)|broadcast|dtype\("
)
#: Characters that steer a terminal.
STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
MAX_LINES = 20

#: Good files that a line may change, and the command that then reads them.
BASES: dict[str, tuple[Any, str]] = {
    "scene": (yaml.safe_load(MINIMAL), "scenes show row.yaml -o new.png"),
    "instrument": (yaml.safe_load((PRESETS / "paper.yaml").read_text()), "budget row.yaml"),
    "spad": (yaml.safe_load((PRESETS / "spad.yaml").read_text()), "budget row.yaml"),
    "plan": (PLAN, "dataset run row.yaml -o new"),
    "study": (STUDY, "study row.yaml -o new"),
    "flight": (FLIGHT, "fly s.yaml --path row.csv -o new"),
    "poses": (FLIGHT, "fly s.yaml --path row.tum -o new"),
    "map": ({"box": "concrete"}, "scenes import box.glb -o new.yaml --materials row.yaml"),
    "obj": ("", "scenes import row.obj -o new.yaml"),
    "ply": ("", "scenes import row.ply -o new.yaml"),
    "stl": ("", "scenes import row.stl -o new.yaml"),
    "sdf": ("", "scenes import row.sdf -o new.yaml"),
    "dae": ("", "scenes import row.dae -o new.yaml"),
    "xml": ("", "scenes import row.xml -o new.yaml"),
    "gltf": ("", "scenes import row.gltf -o new.yaml"),
    "readings": ("", "python -m reconstruction import row.csv -o new.h5 --shape 8x8"),
    "markdown": ("", "paper fig2 -o new --markdown row.md"),
}
SUFFIXES = {"flight": "csv", "poses": "tum", "readings": "csv", "markdown": "md"}
YAML = ("scene", "instrument", "spad", "plan", "study", "map")


class Late(BaseException):
    """Nothing that a command could take for an error of its own."""


@dataclass(frozen=True)
class Row:
    """A bad input: its line, where it stands, and words of the message that it should end with."""

    table: str
    line: str
    words: str

    def __str__(self) -> str:
        return f"{self.table}: {self.line}"

    def arguments(self, desk: Path) -> list[str]:
        """The command line, after the file that it reads was written into the desk."""
        kind, colon, change = self.line.partition(":")
        name = kind.removesuffix(" text")
        if not colon or name not in BASES:
            return [_characters(word) for word in shlex.split(self.line)]
        base, command = BASES[name]
        suffix = "yaml" if name in YAML else SUFFIXES.get(name, name)
        if kind.endswith(" text") or name not in YAML:
            text = _characters(change.strip()).replace("\\n", "\n")
        else:
            text = yaml.safe_dump(changed(base, change), allow_unicode=True, sort_keys=False)
        (desk / f"row.{suffix}").write_text(text, encoding="utf-8", errors="surrogateescape")
        return shlex.split(command)


def rows() -> list[Row]:
    """All rows of all tables."""
    return [row for path in sorted(TABLES.glob("*.txt")) for row in _rows(path)]


def _rows(path: Path) -> Iterator[Row]:
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.strip() and not line.startswith("#"):
            command, _, words = line.rpartition(" | ")
            yield Row(path.stem, command.strip(), words.strip())


def _characters(text: str) -> str:
    r"""With `\x1b`, `\u202e` as the characters that they stand for, `\udcff` as a byte."""
    return re.sub(r"\\(?:x(\w{2})|u(\w{4}))", lambda m: chr(int(m[1] or m[2], 16)), text)


def changed(base: Any, change: str) -> Any:
    """Fields with one set, "objects.0.size_m = [1]", or taken out, "objects.0.name ="."""
    path, _, text = change.partition("=")
    fields = yaml.safe_load(yaml.safe_dump(base, sort_keys=False))
    *way, last = (int(key) if key.isdigit() else key for key in _keys(path.strip()))
    position: Any = fields
    for key in way:
        position = position.setdefault(key, {}) if isinstance(position, dict) else position[key]
    if text.strip():
        position[last] = yaml.safe_load(text)
    else:
        del position[last]
    return fields


def _keys(path: str) -> list[str]:
    """Parts between points; those in backquotes may have points of their own."""
    return [a or b for a, b in re.findall(r"`([^`]*)`|([^.]+)", path)]


def snapshot(folder: Path) -> dict[str, Any]:
    """All that lies in a folder, with what it holds."""
    return {str(path.relative_to(folder)): _reported(path) for path in folder.rglob("*")}


def _reported(path: Path) -> Any:
    status = path.lstat()
    if stat.S_ISLNK(status.st_mode):
        return path.readlink()
    if stat.S_ISREG(status.st_mode):
        return status.st_ino, hashlib.sha256(path.read_bytes()).hexdigest()
    return stat.S_IFMT(status.st_mode)


def call(arguments: list[str]) -> tuple[int, str, str]:
    """Exit status, stdout and stderr of a command in this process."""
    out, error = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error):
        try:
            if arguments[:3] == ["python", "-m", "reconstruction"]:
                status = rig(arguments[3:])
            else:
                status = SPISIM.main(arguments, prog_name="spisim")
        except SystemExit as stop:
            status = int(stop.code or 0)
    return status, out.getvalue(), error.getvalue()


@contextmanager
def limited() -> Iterator[None]:
    """Late for what takes too long, MemoryError for what takes too much."""

    def late(number: int, _: object) -> None:
        raise Late(f"hangs: {signal.Signals(number).name}")

    before = {number: signal.signal(number, late) for number in (signal.SIGPROF, signal.SIGALRM)}
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (_data_bytes() + MEMORY_BYTES, hard))
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.alarm(SAFETY_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
        for number, handler in before.items():
            signal.signal(number, handler)


def _data_bytes() -> int:
    """What this process holds of what the limit counts."""
    status = Path("/proc/self/status")
    if not status.exists():
        return 0
    return 1024 * int(re.search(r"VmData:\s*(\d+)", status.read_text())[1])  # type: ignore[index]


def complaint(row: Row, desk: Path) -> str | None:
    """What is wrong with how a row is refused; None where nothing is."""
    arguments = row.arguments(desk)
    before = snapshot(desk)
    try:
        with limited(), patch.dict("os.environ", COLUMNS="2000"):
            status, out, error = call(arguments)
    except (Exception, Late) as problem:
        return f"{type(problem).__name__}: {problem}"
    message = plain(error)
    if status != 2:
        return f"status {status}: {message or out[:300]}"
    if match := INSIDES.search(message) or STEERING.search(error + out):
        return f"tells {match[0]!r}: {message}"
    if out or not message:
        return f"stdout has {out[:200]!r}, stderr {message!r}"
    if len([line for line in error.splitlines() if line.strip()]) > MAX_LINES:
        return f"{len(error.splitlines())} lines: {message[:300]}"
    if (after := snapshot(desk)) != before:
        return f"changed {[n for n in {**before, **after} if before.get(n) != after.get(n)]}"
    if row.words not in message:
        return f"should say {row.words!r}: {message}"
    return None


def plain(text: str) -> str:
    """A message in one line, without the frame that some have."""
    return " ".join(re.sub("[│╭╮╰╯─]", " ", text).split())
