"""YAML of anyone: plain data, within stated limits, before anything is made or printed of it.

A few hundred bytes of aliases of aliases stand for gigabytes. What a text holds is therefore
counted with its aliases written out, from the parser's events alone.
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import yaml

from reconstruction.base.errors import InputError
from spisim.base.config.messages import show

#: Characters of a text, and of its values once all aliases are written out.
MAX_CHARACTERS = 2_000_000
#: Values, mappings and lists included, once all aliases are written out.
MAX_VALUES = 200_000
#: Mappings and lists within each other.
MAX_DEPTH = 100
#: Characters of a number: more digits than a floating-point number can be large.
MAX_DIGITS = 320

_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # in C where libyaml is there, as usual
_WRITER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_TAG = "tag:yaml.org,2002:"
_NUMBERS = {_TAG + "int", _TAG + "float"}


def load_yaml(text: str, source: Path | str) -> Any:
    """Plain data of a YAML text; `source` is what messages call it.

    Raises InputError for what does not parse, aliases that contain themselves, fields given twice,
    numbers too large for floating point, and more than the limits of this module.
    """
    if len(text) > MAX_CHARACTERS:
        raise InputError(
            f"{source}: {len(text)} characters; at most {MAX_CHARACTERS} of YAML can be read"
        )
    try:
        _check(text)
        # The constructor derives from SafeConstructor: plain data only, no Python objects.
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
    """Of a text that is YAML, but not one to be read."""

    def __init__(self, problem: str, position: Any) -> None:
        super().__init__(problem=problem, problem_mark=position.start_mark)


@dataclass
class _Size:
    """What a value holds, aliases written out."""

    values: int
    characters: int
    depth: int = 0


@dataclass
class _Open:
    """A mapping or list that has not ended yet."""

    anchor: str | None
    size: _Size
    keys: set[str] | None  # of a mapping
    parts: int = 0

    def has_field(self, name: str) -> bool:
        """Whether a mapping's next part, if it is the name of a field, is there already."""
        if self.keys is None or self.parts % 2:
            return False
        valid = name in self.keys
        self.keys.add(name)
        return valid


@dataclass
class _Counter:
    """Goes through a text's events; nothing of it grows beyond the limits."""

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
                f"with its aliases written out, more than {MAX_VALUES} values or "
                f"{MAX_CHARACTERS} characters",
                event,
            )

    def _check_depth(self, more: int, event: yaml.Event) -> None:
        if len(self.open) - 1 + more > MAX_DEPTH:
            raise _Refusal(f"more than {MAX_DEPTH} mappings and lists within each other", event)


def _check(text: str) -> None:
    counter = _Counter()
    for event in yaml.parse(text, Loader=_PARSER):
        counter.take(event)


class _Constructor(yaml.constructor.SafeConstructor):
    """Values that JSON has too; whatever does not fit its tag is told by its line."""

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
        # PyYAML raises whatever a value under a wrong tag runs it into.
        except (LookupError, ValueError, TypeError, AttributeError, ArithmeticError):
            kind = node.tag.rpartition(":")[2]
            raise _Refusal(f"{show(node.value)} is no {show(kind)}", node) from None
        if isinstance(value, int) and abs(value) > sys.float_info.max:
            raise _Refusal(f"{show(node.value, 20)} is beyond 1.8e308", node)
        return value
