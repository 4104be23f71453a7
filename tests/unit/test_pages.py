"""Code blocks of the README and the pages: commands, options and files are there."""

import ast
import re
import warnings

import pytest

from pages import PAGES, ROOT, SHELLS, Block, blocks, check_command, check_yaml, commands

BLOCKS = [block for page in PAGES for block in blocks(page)]
#: At most so much of all that could be run may be printed without being run.
MAX_NOT_RUN = 0.25
#: Languages whose blocks are checked or run.
AVAILABLE = {*SHELLS, "python", "yaml", "toml", "cpp", "c", "matlab", "text", "json"}


def of(*languages: str) -> list[Block]:
    return [block for block in BLOCKS if block.language in languages]


@pytest.mark.parametrize("block", of(*SHELLS), ids=str)
def test_every_command_has_the_options_that_a_page_gives_it(block):
    for words in [*commands(block.text), *commands(block.first or "")]:
        check_command(words, block.page)


@pytest.mark.parametrize("block", of("python"), ids=str)
def test_every_piece_of_python_is_some(block):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ast.parse(block.text)


@pytest.mark.parametrize("block", of("yaml"), ids=str)
def test_every_file_is_what_it_stands_for(block):
    check_yaml(block)


def test_blocks_tell_their_language():
    strange = [str(block) for block in BLOCKS if block.language not in AVAILABLE]
    assert not strange, "a fence names its language; what is no code is text"


def test_commands_stand_in_fences():
    for page in PAGES:
        outside = re.sub(
            r"^ *```.*?^ *```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S
        )
        bare = re.findall(r"^(?: {4}|\t)(?:spisim|python|make|pip) .*", outside, re.M)
        assert not bare, page.relative_to(ROOT)


def test_most_of_what_is_printed_is_run(record_property):
    runnable = of(*SHELLS, "python")
    left = [block for block in runnable if block.not_run]
    record_property("not run", f"{len(left)} of {len(runnable)} blocks")
    text = "\n".join(f"{block}: {block.not_run}" for block in left)
    assert len(left) <= MAX_NOT_RUN * len(runnable), text


def test_files_of_one_name_are_of_one_kind():
    kinds: dict[str, set[str]] = {}
    for block in of("yaml"):
        if block.title:
            kind = "instrument" if "projector:" in block.text else "other"
            kinds.setdefault(block.title.rpartition("/")[2], set()).add(kind)
    assert all(len(kind) == 1 for kind in kinds.values())


def test_words_of_commands_are_told_apart():
    text = "A=1 spisim budget x.yaml | head -3 && make demo > out.txt  # a note\nls \\\n  -l\n"
    assert list(commands(text)) == [
        ["A=1", "spisim", "budget", "x.yaml"],
        ["head", "-3"],
        ["make", "demo"],
        ["ls", "-l"],
    ]
