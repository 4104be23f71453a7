"""Code blocks of the README and the pages: found, checked, and run as they are printed.

A fenced block of a language is code: `sh`, `python`, `yaml`, … What it needs stands above it in a
comment that no reader sees:

    <!-- not run: why -->            it is checked, but never run
    <!-- first: spisim simulate … --> commands that make what it reads

A `title="hall.yaml"` in the fence is a file of that name, which later blocks find. Blocks of a page
run one after the other in one folder, those of Python in one namespace, those of the shell with one
environment.
"""

import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import typer

from reconstruction.cli import _parser as reconstruction_parser
from reconstruction.cli import is_command
from spisim.base.config import check_fields, load_yaml
from spisim.dataset.plan import Plan
from spisim.dataset.study.plan import StudyPlan
from spisim.instrument import Instrument, load_instrument
from spisim.scene.description import DrawnDescription, SceneDescription
from spisim_app.cli import app
from spisim_inverse.design.plan import DesignPlan

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SHELLS = ("sh", "bash")

BLOCK = re.compile(
    r"(?P<above>(?:^[ ]*<!--(?:(?!-->).)*-->\n)*)"
    r"^(?P<indent>[ ]*)```(?P<language>\w*)(?P<info>[^\n]*)\n(?P<text>.*?)^(?P=indent)```[ ]*$",
    re.M | re.S,
)


@dataclass(frozen=True)
class Block:
    """A fenced block and what is said of it."""

    page: Path
    line: int
    language: str
    title: str | None
    text: str
    not_run: str | None
    first: str | None

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path) -> list[Block]:
    """Fenced blocks of a page, in their order."""
    text = page.read_text(encoding="utf-8")
    return [_block(page, text, match) for match in BLOCK.finditer(text)]


def _block(page: Path, text: str, match: re.Match[str]) -> Block:
    title = re.search(r'title="([^"]+)"', match["info"])
    inside = re.sub(rf"^{match['indent']}", "", match["text"], flags=re.M)
    return Block(
        page=page,
        line=text.count("\n", 0, match.start("language")) + 1,
        language=match["language"],
        title=title and title[1],
        text=inside,
        not_run=_said(match["above"], "not run"),
        first=_said(match["above"], "first"),
    )


def _said(above: str, word: str) -> str | None:
    match = re.search(rf"<!-- {word}: (.*?) -->", above, re.S)
    return match and match[1]


def commands(shell: str) -> Iterator[list[str]]:
    """Words of every single command of a shell's text, without those of pipes and lists."""
    text = re.sub(r"\\\n", " ", shell)
    for line in text.splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars="|&;()<>")
        lexer.whitespace_split = True
        words: list[str] = []
        for word in lexer:
            if set(word) <= set("|&;()"):
                yield from [words] if words else []
                words = []
            elif set(word) <= set("<>"):
                next(lexer, None)  # the file that it goes to
            else:
                words.append(word)
        yield from [words] if words else []


def check_command(words: list[str], page: Path) -> None:
    """That its verb and options are there; nothing is run. Raises where they are not."""
    while words and re.fullmatch(r"\w+=.*", words[0]):
        words = words[1:]
    match words:
        case ["spisim", *arguments]:
            _parse_spisim(arguments)
        case ["python", "-m", "reconstruction", *arguments]:
            called = arguments if is_command(arguments[0]) else ["reconstruct", *arguments]
            reconstruction_parser(called[:1]).parse_args(called)
        case ["python", file, *_] if file.endswith(".py"):
            named = {block.title for block in blocks(page)}
            assert file in named or (ROOT / file).is_file(), f"there is no {file}"
        case ["make", target, *_]:
            assert f"\n{target}:" in (ROOT / "Makefile").read_text(encoding="utf-8")


@cache
def _spisim() -> Any:
    return typer.main.get_command(app)


def _parse_spisim(arguments: list[str]) -> None:
    """Read the arguments as the command would, up to what it would do."""
    command, name, parent = _spisim(), "spisim", None
    while True:
        context = command.make_context(name, list(arguments), parent=parent)
        if not hasattr(command, "resolve_command"):
            return
        name, command, arguments = command.resolve_command(
            context, [*context._protected_args, *context.args]
        )
        parent = context


def check_yaml(block: Block) -> None:
    """That a file or a part of one is read as what it is. Raises InputError where it is not."""
    source = str(block)
    fields = load_yaml(block.text, source)
    assert isinstance(fields, Mapping), f"{source}: no mapping"
    if fields.keys() & {"judgement", "choose"}:
        check_fields({**_A_DESIGN, **fields}, DesignPlan, source)
    elif "study" in fields:
        check_fields({**_A_PLAN, **fields}, StudyPlan, source)
    elif fields.keys() & {"samples", "scenes", "vary"}:
        check_fields({**_A_PLAN, **fields}, Plan, source)
    elif fields.keys() & Instrument.model_fields.keys():
        preset = "vl53l5cx" if "zones" in fields else "paper"
        usual = load_yaml(load_instrument(preset).text, preset)
        check_fields({**usual, **fields}, Instrument, source)
    elif "family" in fields or not {"drone", "objects"} <= fields.keys():
        check_fields({"family": "targets", **fields}, DrawnDescription, source)
    else:
        check_fields(fields, SceneDescription, source)


_A_DESIGN = {
    "name": "part",
    "search": [{"scene": "warehouse"}],
    "judgement": [{"scene": "tunnel"}],
    "weathers": {"clear": {}},
    "choose": {"plan.patterns": {"low": 63, "high": 127}},
    "objectives": ["range_error_m"],
}
_A_PLAN = {"name": "part", "scenes": [{"scene": "warehouse"}]}
