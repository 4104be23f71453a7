"""YAML from untrusted sources: plain data within stated limits, checked before it is built.

A few hundred bytes of nested aliases can expand to gigabytes, so the expanded size is counted from
the parser's events alone.
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import yaml

from reconstruction.base.errors import InputError
from spisim.base.config.messages import show

#: Maximum characters of a text, and of its values with all aliases expanded.
MAX_CHARACTERS = 2_000_000
#: Maximum number of values, mappings and lists included, with all aliases expanded.
MAX_VALUES = 200_000
#: Maximum nesting of mappings and lists.
MAX_DEPTH = 100
#: Maximum characters of a number; the largest float has 309 digits.
MAX_DIGITS = 320

_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # in C if libyaml is present
_WRITER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_TAG = "tag:yaml.org,2002:"
_NUMBERS = {_TAG + "int", _TAG + "float"}


def load_yaml(text: str, source: Path | str) -> Any:
    """Plain data of a YAML text.

    Parameters
    ----------
    text : str
        The YAML.
    source : Path or str
        What messages call the text.

    Raises
    ------
    InputError
        For invalid YAML, recursive aliases, duplicate fields, numbers beyond floating point, and
        anything beyond the limits of this module.
    """
    if len(text) > MAX_CHARACTERS:
        raise InputError(
            f"{source}: {len(text)} characters; at most {MAX_CHARACTERS} of YAML can be read"
        )
    try:
        _check(text)
        # Derived from SafeConstructor: plain data, no Python objects.
        node = yaml.compose(text, Loader=_PARSER)
        return None if node is None else _Constructor().construct_document(node)
    except yaml.MarkedYAMLError as error:
        where = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        what = "" if isinstance(error, _Refusal) else "not valid YAML: "
        raise InputError(f"{source}{where}: {what}{error.problem}") from None
    except (yaml.YAMLError, UnicodeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{source}: not valid YAML: {reason}") from None


def dump_yaml(fields: Any) -> str:
    """YAML text of plain data, in the order given."""
    text: str = yaml.dump(fields, Dumper=_WRITER, sort_keys=False, allow_unicode=True)
    return text


class _Refusal(yaml.MarkedYAMLError):
    """Valid YAML that is refused."""

    def __init__(self, problem: str, node: Any) -> None:
        super().__init__(problem=problem, problem_mark=node.start_mark)


@dataclass
class _Size:
    """Size of a value with its aliases expanded."""

    values: int
    characters: int
    depth: int = 0


@dataclass
class _Open:
    """A mapping or list that has not ended yet."""

    anchor: str | None
    size: _Size
    keys: set[str] | None  # None for a list
    parts: int = 0

    def has_field(self, name: str) -> bool:
        """Whether the next part of a mapping is a field name that it already has."""
        if self.keys is None or self.parts % 2:
            return False
        duplicate = name in self.keys
        self.keys.add(name)
        return duplicate


@dataclass
class _Counter:
    """Counts the events of a text; memory stays within the limits."""

    open: list[_Open] = field(default_factory=lambda: [_Open(None, _Size(0, 0), None)])
    sizes: dict[str, _Size] = field(default_factory=dict)

    def take(self, event: yaml.Event) -> None:
        if isinstance(event, yaml.CollectionEndEvent):
            ended = self.open.pop()
            self._add(ended.size, ended.anchor, event)
        elif isinstance(event, yaml.NodeEvent):
            if isinstance(event, yaml.CollectionStartEvent):
                self._begin(event)
            elif isinstance(event, yaml.AliasEvent):
                self._alias(event)
            elif isinstance(event, yaml.ScalarEvent):
                if self.open[-1].has_field(event.value):
                    raise _Refusal(f"field {show(event.value)} is given twice", event)
                self._add(_Size(1, len(event.value)), event.anchor, event)

    def _begin(self, event: yaml.CollectionStartEvent) -> None:
        keys: set[str] | None = set() if isinstance(event, yaml.MappingStartEvent) else None
        self.open.append(_Open(event.anchor, _Size(1, 0, 1), keys))
        self._check_depth(0, event)

    def _alias(self, event: Any) -> None:
        if any(each.anchor == event.anchor for each in self.open):
            raise _Refusal(f"a value of it contains itself: {show(event.anchor)}", event)
        self._add(self.sizes.get(event.anchor, _Size(1, 0)), None, event)

    def _add(self, size: _Size, anchor: str | None, event: yaml.Event) -> None:
        self._check_depth(size.depth, event)
        whole = self.open[-1]
        whole.parts += 1
        whole.size.values += size.values
        whole.size.characters += size.characters
        whole.size.depth = max(whole.size.depth, size.depth + 1)
        if anchor is not None:
            self.sizes[anchor] = size
        if whole.size.values > MAX_VALUES or whole.size.characters > MAX_CHARACTERS:
            raise _Refusal(
                f"with its aliases expanded, more than {MAX_VALUES} values or "
                f"{MAX_CHARACTERS} characters",
                event,
            )

    def _check_depth(self, more: int, event: yaml.Event) -> None:
        if len(self.open) - 1 + more > MAX_DEPTH:
            raise _Refusal(f"more than {MAX_DEPTH} nested mappings and lists", event)


def _check(text: str) -> None:
    counter = _Counter()
    for event in yaml.parse(text, Loader=_PARSER):
        counter.take(event)


class _Constructor(yaml.constructor.SafeConstructor):
    """Builds the types of JSON; an error names the line of a value that does not fit its tag."""

    yaml_constructors: ClassVar[dict[Any, Any]] = {
        _TAG + kind: getattr(yaml.constructor.SafeConstructor, f"construct_yaml_{kind}")
        for kind in ("null", "bool", "int", "float", "str", "seq", "map")
    } | {
        _TAG + "timestamp": yaml.constructor.SafeConstructor.construct_yaml_str,
        None: yaml.constructor.SafeConstructor.construct_undefined,
    }

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        if node.tag in _NUMBERS and len(node.value) > MAX_DIGITS:
            raise _Refusal(f"a number of {len(node.value)} characters", node)
        try:
            value = super().construct_object(node, deep)
        # PyYAML raises many kinds of exceptions for a value under a wrong tag.
        except (LookupError, ValueError, TypeError, AttributeError, ArithmeticError):
            kind = node.tag.rpartition(":")[2]
            raise _Refusal(f"{show(node.value)} is no {show(kind)}", node) from None
        if isinstance(value, int) and abs(value) > sys.float_info.max:
            raise _Refusal(f"{show(node.value, 20)} is beyond 1.8e308", node)
        return value
