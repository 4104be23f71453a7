"""The slow tests in parts that take minutes each; every commit's check runs one of them.

A test's part follows from its name alone: it stays where it is when others come and go.
"""

from zlib import crc32

import pytest

PARTS = 5


def part_of(name: str) -> int:
    """The part, from 0 to PARTS - 1, in which the test of this name (node id) runs."""
    return crc32(name.encode()) % PARTS


def pytest_addoption(parser: pytest.Parser) -> None:
    text = f"run one of {PARTS} parts of the tests only, NUMBER modulo {PARTS}"
    parser.addoption("--part", type=int, metavar="NUMBER", help=text)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    part = config.getoption("--part")
    if part is None:
        return
    others = [item for item in items if part_of(item.nodeid) != part % PARTS]
    config.hook.pytest_deselected(items=others)
    items[:] = [item for item in items if part_of(item.nodeid) == part % PARTS]
