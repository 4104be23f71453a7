"""YAML of strangers: what it would grow to is known before it does."""

import pytest

from reconstruction.base.errors import InputError
from spisim.base.config import load_yaml, yaml


def bomb(levels: int, width: int = 9) -> str:
    """Text of a few hundred bytes that stands for `width` to the power of `levels` words."""
    lines = [f"a0: &a0 [{', '.join(['fog'] * width)}]"]
    for level in range(1, levels):
        lines.append(f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * width)}]")
    return "\n".join(lines)


@pytest.mark.parametrize(
    "text",
    [
        bomb(9),
        f"a: &a {'y' * 60}\nb: &b [{'*a,' * 99}]\nc: [{'*b,' * 999}]",
        "a: &a {" + ", ".join(f"f{k}: 1" for k in range(1000)) + "}\nb:\n" + "  - {<<: *a}\n" * 400,
        "a: &a {x: 1, y: 2}\n" + "".join(
            f"b{k}: &b{k} {{<<: [{', '.join(['*a' if k == 0 else f'*b{k - 1}'] * 9)}]}}\n"
            for k in range(9)
        ),
    ],
    ids=["nine levels", "long words", "merges", "merges of merges"],
)  # fmt: skip
def test_aliases_that_would_grow_are_refused(text: str) -> None:
    assert len(text) < 25_000
    with pytest.raises(InputError, match="with its aliases expanded, more than 200000 values"):
        load_yaml(text, "bomb.yaml")


def test_values_are_counted_without_aliases(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "a: [0, 1, 2, 3, 4, 5]"
    monkeypatch.setattr(yaml, "MAX_VALUES", 9)
    load_yaml(text, "short.yaml")
    monkeypatch.setattr(yaml, "MAX_VALUES", 7)
    with pytest.raises(InputError, match="more than 7 values"):
        load_yaml(text, "long.yaml")


def test_ordinary_aliases_and_merges_are_read() -> None:
    text = """
        base: &base {kind: sphere, radius_m: 1}
        all: [*base, {<<: *base, radius_m: 2}, {<<: [*base, {colour: 3}], name: c}]
        last: [*base]
    """
    read = load_yaml(text, "some.yaml")
    assert read["all"] == [
        {"kind": "sphere", "radius_m": 1},
        {"kind": "sphere", "radius_m": 2},
        {"kind": "sphere", "radius_m": 1, "colour": 3, "name": "c"},
    ]
    assert read["last"] == [read["base"]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: &a [*a]", "line 1: a value of it contains itself: 'a'"),
        ("b: 1\na: &a {x: {y: [*a]}}", "line 2: a value of it contains itself"),
        # PyYAML from 6.0.4 on has a limit of its own for brackets that nest this deep.
        ("[" * 5000, "more than 100 nested mappings and lists|maximum nesting depth"),
        (
            f"a0: &a0 {'[' * 50}{']' * 50}\n"
            + "\n".join(f"a{k}: &a{k} {'[' * 50}*a{k - 1}{']' * 50}" for k in range(1, 30)),
            "line 2: more than 100 nested mappings and lists",
        ),
        ("[" * 200, "more than 100 nested mappings and lists"),
        ("- " * 5000, "more than 100 nested mappings and lists"),
        ("a: " + "9" * 400, r"line 1: a number of 400 characters"),
        ("a: 0x" + "f" * 300, "is beyond 1.8e308"),
        ("a: " + "9" * 310, "is beyond 1.8e308"),
        ("a: 1" + ":1" * 500, "a number of 1001 characters"),
        ("a: 1" + ":1" * 500 + ".5", "a number of 1003 characters"),
        ("x: 1\nx: 2", "line 2: field 'x' is given twice"),
        ("a: !!bool maybe", "'maybe' is no 'bool'"),
        ("a: !!int ''", "'' is no 'int'"),
        ("a: !!float many", "'many' is no 'float'"),
        ("a: !!set {b, c}", "could not determine a constructor"),
        ("a: !!binary aGVsbG8=", "could not determine a constructor"),
        ("a: !!python/object/apply:os.getcwd []", "could not determine a constructor"),
        ("[a]: 1", "found unhashable key"),
        ("a: *b", "undefined alias"),
        ("--- 1\n--- 2", "another document"),
        ("a: \x00", "not valid YAML"),
        ("a: \ud800", "not valid YAML"),
        ("#" + "x" * 2_000_000, "2000001 characters; at most 2000000 of YAML"),
        ("[" + "1," * 200_000 + "]", "more than 200000 values"),
    ],
)
def test_what_is_refused_is_named(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        load_yaml(text, "some.yaml")
    assert str(caught.value).startswith("some.yaml")
    assert len(str(caught.value)) < 300


def test_values_are_those_that_json_has() -> None:
    read = load_yaml("{a: 2024-01-01, b: !!timestamp x, c: 0x1f, d: 1:30, e: .inf, f: ~}", "")
    assert read == {"a": "2024-01-01", "b": "x", "c": 31, "d": 90, "e": float("inf"), "f": None}
    assert load_yaml("", "empty") is None
