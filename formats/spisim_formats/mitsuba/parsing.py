"""Elements of Mitsuba's scene files through Mitsuba's own parser, which instantiates nothing."""

from __future__ import annotations

import re

import mitsuba.scalar_rgb  # noqa: F401 (the types of colours and transforms; selects no variant)
import numpy as np
from mitsuba import Properties, parser

from reconstruction.base.errors import InputError, nearest
from spisim_formats.mitsuba.elements import Elements, Node

Type = Properties.Type
#: What the parser's messages tell of itself, and of the text that it was given.
SOURCE = re.compile(r"\[\w+\.cpp:\d+\] ")
POSITION = re.compile(r"Error while loading string \(line (\d+), col \d+\): ")
#: Names that it gives to what has none.
UNNAMED = "_arg_"


def parse(elements: Elements) -> Node:
    """The scene that elements make; InputError for what Mitsuba refuses, naming the file of it."""
    lines = ['<scene version="3.0.0">', *(text for text, _ in elements), "</scene>"]
    try:
        state = parser.parse_string(parser.ParserConfig("scalar_rgb"), "\n".join(lines))
    except RuntimeError as error:
        reason = SOURCE.sub("", " ".join(str(error).split())).partition(" (previous was at ")[0]
        position = POSITION.match(reason)
        file = f"{elements[int(position[1]) - 2][1]}: " if position else ""
        raise InputError(f"{file}{POSITION.sub('', reason, count=1):.300}") from None
    nodes = [
        Node(each.type.name.lower(), each.props.plugin_name(), each.props.id())
        for each in state.nodes
    ]
    by_id = state.id_to_index  # a copy, each time
    for node, each in zip(nodes, state.nodes, strict=True):
        for key in each.props.keys():  # noqa: SIM118 (no mapping)
            value = each.props[key]
            match each.props.type(key):
                case Type.Transform:
                    value = np.array(value.matrix)
                case Type.Vector | Type.Color:
                    value = np.array(value)
                # Of the longest wavelength, which is nearest to infrared; its stubs lack the type
                case Type.Spectrum:  # type: ignore[attr-defined]
                    last = 0 if value.is_uniform() else int(np.argmax(value.wavelengths))
                    value = float(value.values[last])
                case Type.Reference if node.kind == "sensor" and value.id() not in by_id:
                    continue  # to a film, say
                case Type.Reference:
                    value = _result(value.id(), nodes, by_id)
                case Type.ResolvedReference:
                    value = nodes[value.index()]
                    value.name = "" if key.startswith(UNNAMED) else key
            node.properties[key] = value
    return nodes[0]


def _result(name: str, nodes: list[Node], by_id: dict[str, int]) -> Node:
    """The node of an id; the parser would follow references in turn until its stack overflows."""
    if name not in by_id:
        raise InputError(f"ref {name[:80]!r}: {nearest(name, by_id)}")
    return nodes[by_id[name]]
