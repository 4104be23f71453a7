"""Documents changed at random as their own format has it: elements, fields, numbers, references."""

import copy
import json
import random
from collections.abc import Iterator
from itertools import islice
from typing import Any
from xml.etree import ElementTree as ET

NUMBERS = ("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "-1", "0", "0.5", "2147483648",
           "99999999999999999999", "1e999", "0x10", "", "1,5", "true", "[]", "null")  # fmt: skip
VALUES: tuple[Any, ...] = (None, True, False, -1, 0, 1, 2, 0.5, 1e308, float("nan"), float("inf"),
    2**31, 2**40, 2**63, 10**30, "", "x", "0", [], {}, [[]], [None], [0], {"a": 0}, "\x00",
    [1e308] * 3, [0.0] * 16, [1, 2, 3])  # fmt: skip
TOKENS = (b"-1", b"0", b"nan", b"1e999", b"99999999999", b"null", b"[]", b"{}", b"<", b"/", b"\0")


def references(outside: str) -> tuple[str, ...]:
    """Where references lead that should not: `outside` is a file in a folder above."""
    name = outside.rpartition("/")[2]
    return (f"../{name}", outside, f"file://{outside}", f"file:../{name}", f"model://../{name}",
            f"model://{outside}", f"package://m/../../{name}", f"./x/../../{name}", "/etc/passwd",
            "file:///etc/passwd", "/dev/zero", "/proc/self/environ", "http://127.0.0.1:9/a.obj",
            "https://example.invalid/a", "\\\\host\\share", "..", ".", "/", "", "~", "\x01",
            "a" * 5000, "data:,x", "data:application/octet-stream;base64,!!",
            "data:application/octet-stream;base64," + "A" * 20_000, "a.sdf", "a.xml", "a.dae",
            "loop.xml", "loop.sdf", "model://loop", "link.obj", "link", "#", "#nothing", "%2e%2e/x",
            "%00", "$r", "$missing", "${r}")  # fmt: skip


def damaged(sound: bytes, rng: random.Random) -> bytes:
    """A few bytes changed, cut out, replaced by a token, or repeated elsewhere."""
    data = bytearray(sound)
    for _ in range(rng.choice([1, 1, 2, 5])):
        position, other = rng.randrange(len(data)), rng.randrange(len(data))
        match rng.randrange(4):
            case 0:
                data[position] = rng.randrange(256)
            case 1:
                del data[position : position + rng.randrange(1, 20)]
            case 2:
                data[position : position + rng.randrange(6)] = rng.choice(TOKENS)
            case 3:
                data[position:position] = data[other : other + rng.randrange(1, 40)]
    return bytes(data)


def xml_mutant(sound: str, rng: random.Random, hostile: tuple[str, ...]) -> bytes:
    """An XML document with a few of its elements, texts and attributes changed.

    `hostile` are texts to put in place of names, references and numbers.
    """
    root = ET.fromstring(sound)
    if root.tag.startswith("{"):
        ET.register_namespace("", root.tag[1:].partition("}")[0])
    for _ in range(rng.choice([1, 1, 2, 3, 6])):
        elements = list(root.iter())
        chosen, other = rng.choice(elements), rng.choice(elements)
        if rng.random() < 0.5:
            _change_element(root, chosen, other, rng)
        else:
            _change_text(chosen, other, rng, hostile)
    return ET.tostring(root)


def _change_element(
    root: ET.Element, chosen: ET.Element, other: ET.Element, rng: random.Random
) -> None:
    match rng.randrange(5):
        case 0:
            chosen.tag = rng.choice([other.tag, "x", "{x}y"])
        case 1:
            _remove(root, chosen)
        case 2:
            chosen.append(copy.deepcopy(other))
        case 3:
            _remove(root, chosen)
            if chosen is not root and other not in list(chosen.iter()):
                other.append(chosen)
        case 4:
            _wrap(chosen, other, rng)


def _change_text(
    chosen: ET.Element, other: ET.Element, rng: random.Random, hostile: tuple[str, ...]
) -> None:
    if not chosen.attrib or rng.random() < 0.3:
        chosen.text = _text(chosen.text or "", other.text or "", rng, hostile)
        return
    key = rng.choice(list(chosen.attrib))
    if rng.random() < 0.7:
        chosen.set(key, _text(chosen.get(key, ""), _any(other, rng), rng, hostile))
        return
    value = chosen.attrib.pop(key)
    if rng.random() < 0.5:
        chosen.set(rng.choice(list(other.attrib) or ["x"]), value)


def _remove(root: ET.Element, chosen: ET.Element) -> None:
    for parent in root.iter():
        if chosen in list(parent):
            parent.remove(chosen)
            return


def _any(element: ET.Element, rng: random.Random) -> str:
    return rng.choice([*element.attrib.values(), element.text or ""])


def _text(own: str, other: str, rng: random.Random, hostile: tuple[str, ...]) -> str:
    words = own.split()
    match rng.randrange(5):
        case 0:
            return rng.choice(hostile)
        case 1:
            return other
        case 2 if words:
            words[rng.randrange(len(words))] = rng.choice(NUMBERS)
            return " ".join(words)
        case 3 if 0 < len(words) < 100:
            return " ".join(words * rng.choice([2, 50]))
    return rng.choice(NUMBERS)


def _wrap(chosen: ET.Element, other: ET.Element, rng: random.Random) -> None:
    """Copies side by side, or one in another deeply."""
    piece = copy.deepcopy(other)
    if len(list(piece.iter())) > 20:
        return
    count = rng.choice([2, 30, 250])
    if rng.random() < 0.5:
        chosen.extend(copy.deepcopy(piece) for _ in range(count))
        return
    at = chosen
    for _ in range(count):
        at = ET.SubElement(at, piece.tag, piece.attrib)
    at.append(piece)


def json_mutant(sound: Any, rng: random.Random, hostile: tuple[str, ...]) -> Any:
    """A tree of dicts and lists with a few of its fields changed, as `xml_mutant`."""
    data = copy.deepcopy(sound)
    for _ in range(rng.choice([1, 1, 2, 3, 6])):
        positions = list(islice(_positions(data), 2000))
        if not positions:
            return data
        holder, key = rng.choice(positions)
        other, other_key = rng.choice(positions)
        if rng.random() < 0.3:
            _change_field(holder, key, other_key, rng)
        else:
            holder[key] = _value(holder[key], other[other_key], rng, hostile)
    positions = list(_positions(data))
    if positions and rng.random() < 0.05:
        holder, key = rng.choice(positions)
        for _ in range(rng.choice([3, 300])):
            holder[key] = [holder[key]]
    return data


def _change_field(holder: Any, key: Any, other_key: Any, rng: random.Random) -> None:
    if rng.random() < 0.5:
        del holder[key]
    elif isinstance(holder, dict):
        holder[rng.choice(["x", "", str(other_key)])] = holder.pop(key)
    elif len(holder) < 10:
        holder[:] = holder * rng.choice([2, 40])


def _value(own: Any, other: Any, rng: random.Random, hostile: tuple[str, ...]) -> Any:
    if isinstance(own, str) and rng.random() < 0.7:
        return rng.choice(hostile)
    if isinstance(own, int | float) and rng.random() < 0.5:
        return own + rng.choice([-1, 1, 1000])
    return copy.deepcopy(rng.choice([other, rng.choice(VALUES)]))


def _positions(data: Any) -> Iterator[tuple[Any, Any]]:
    items = list(data.items()) if isinstance(data, dict) else list(enumerate(data))
    for key, value in items:
        yield data, key
        if isinstance(value, dict | list):
            yield from _positions(value)


def json_text(data: Any) -> bytes:
    """JSON, numbers that are none included, as Python's parser reads them."""
    try:
        return json.dumps(data).encode()
    except RecursionError:
        return b"[" * 100_000
