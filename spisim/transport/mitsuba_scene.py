"""Scene files of Mitsuba, read by Mitsuba's own parser; nothing in them is instantiated."""

from __future__ import annotations

import re
from pathlib import Path

import mitsuba.scalar_rgb  # noqa: F401 (the types of colours and transforms; selects no variant)
import numpy as np
from mitsuba import Properties, parser

from reconstruction.errors import InputError, nearest
from spisim.scene.importing.files import Folders
from spisim.scene.importing.mitsuba_file import Elements, Node
from spisim.scene.importing.mitsuba_xml import read_scene
from spisim.scene.importing.model import Content

Type = Properties.Type
#: A line of the text that is parsed, and what the parser's messages say beside the reason.
LINE = re.compile(r"\(line (\d+), col \d+\)")
BESIDE = re.compile(
    rf"\[\w+\.cpp:\d+\] |Error while loading string {LINE.pattern}: | \(previous .*"
)
#: Names that it gives to what has none.
UNNAMED = "_arg_"


def read_mitsuba(path: Path, folders: Folders) -> Content:
    """Parts of a Mitsuba scene; InputError for what cannot be read."""
    return read_scene(path, folders, parse)


def parse(elements: Elements) -> Node:
    """The scene that elements make; InputError for what Mitsuba refuses, naming the file of it."""
    lines = ['<scene version="3.0.0">', *(text for text, _ in elements), "</scene>"]
    try:
        state = parser.parse_string(parser.ParserConfig("scalar_rgb"), "\n".join(lines))
    except RuntimeError as error:
        text = " ".join(str(error).split())
        line = LINE.search(text)
        file = f"{elements[int(line[1]) - 2][1]}: " if line else ""
        raise InputError(file + BESIDE.sub("", text)) from None
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
                case Type.Reference:
                    value = _found(value.id(), nodes, by_id)
                case Type.ResolvedReference:
                    value = nodes[value.index()]
                    value.name = "" if key.startswith(UNNAMED) else key
            node.properties[key] = value
    return nodes[0]


def _found(name: str, nodes: list[Node], by_id: dict[str, int]) -> Node:
    """The node of an id; the parser would follow references in turn until its stack overflows."""
    if name not in by_id:
        raise InputError(f"ref {name!r}: {nearest(name, by_id)}")
    return nodes[by_id[name]]
