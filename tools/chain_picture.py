"""Draw the chain from scene to result: `python tools/chain_picture.py`, into docs/images."""

from pathlib import Path

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "chain.svg"

#: Columns of the picture: heading, then boxes from the top, each with a line on what it holds.
COLUMNS = [
    (
        "you write",
        [
            ("scene.yaml", "objects, materials,", "fog, daylight, drone"),
            ("instrument.yaml", "projector, detector,", "lasers, electronics"),
        ],
    ),
    (
        "spisim simulates",
        [
            ("light", "traced once: a transport", "image and four echoes"),
            ("electrons", "patterns, shot noise,", "dark current, amplifier"),
        ],
    ),
    (
        "a capture",
        [
            ("capture.h5", "raw counts of patterns", "and spots, calibration"),
            ("a rig", "records the same file,", "or sends it live"),
        ],
    ),
    (
        "reconstruction",
        [
            ("image and ranges", "inverse problem and", "time of flight"),
            ("depth map", "ranges and brightness", "together"),
        ],
    ),
    (
        "you get",
        [
            ("result", "image, ranges, depth,", "point cloud"),
            ("errors", "against the truth,", "in data sets and studies"),
        ],
    ),
]
WIDTH, HEIGHT, GAP, TOP = 194, 84, 40, 44
#: From which box to which: column and row, counted from 0.
ARROWS = [
    ((0, 0), (1, 0)),
    ((0, 1), (1, 1)),
    ((1, 0), (1, 1)),
    ((1, 1), (2, 0)),
    ((2, 1), (2, 0)),
    ((2, 0), (3, 0)),
    ((3, 0), (3, 1)),
    ((3, 1), (4, 0)),
    ((4, 0), (4, 1)),
]


def corner(column: int, row: int) -> tuple[int, int]:
    """Upper left corner of a box."""
    return column * (WIDTH + GAP) + 12, TOP + row * (HEIGHT + GAP)


def box(column: int, row: int, lines: tuple[str, str, str]) -> str:
    """A box with its three lines."""
    x, y = corner(column, row)
    middle = x + WIDTH // 2
    title, *rest = lines
    texts = [f'<text class="name" x="{middle}" y="{y + 27}">{title}</text>']
    texts += [
        f'<text class="what" x="{middle}" y="{y + 49 + 19 * k}">{line}</text>'
        for k, line in enumerate(rest)
    ]
    shape = f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="8"/>'
    return "\n".join([shape, *texts])


def arrow(start: tuple[int, int], end: tuple[int, int]) -> str:
    """An arrow from the side of a box to that of the next."""
    (x0, y0), (x1, y1) = corner(*start), corner(*end)
    if start[0] == end[0]:
        down = y1 > y0
        x = x0 + WIDTH // 2
        ends = (x, y0 + HEIGHT if down else y0, x, y1 if down else y1 + HEIGHT)
    else:
        ends = (x0 + WIDTH, y0 + HEIGHT // 2, x1, y1 + HEIGHT // 2)
    return '<line x1="{}" y1="{}" x2="{}" y2="{}" marker-end="url(#tip)"/>'.format(*ends)


def picture() -> str:
    """The whole picture."""
    width = len(COLUMNS) * (WIDTH + GAP) - GAP + 24
    height = TOP + 2 * HEIGHT + GAP + 14
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">',
        "<title>From scene and instrument to image, ranges and depth</title>",
        "<style>",
        "text { font-family: sans-serif; text-anchor: middle; fill: #1b2a33 }",
        ".head { font-size: 15px; fill: #5c6f7a } .name { font-size: 17px; font-weight: bold }",
        ".what { font-size: 14px } rect { fill: #e8f0f4; stroke: #546e7a; stroke-width: 1.5 }",
        "line { stroke: #d0632b; stroke-width: 2.5 } #tip path { fill: #d0632b }",
        "</style>",
        '<defs><marker id="tip" markerWidth="9" markerHeight="8" refX="8" refY="4" orient="auto">',
        '<path d="M0,0 L9,4 L0,8 Z"/></marker></defs>',
        f'<rect x="0" y="0" width="{width}" height="{height}" style="fill:#fff;stroke:none"/>',
    ]
    for column, (heading, boxes) in enumerate(COLUMNS):
        x, _ = corner(column, 0)
        parts.append(f'<text class="head" x="{x + WIDTH // 2}" y="28">{heading}</text>')
        parts += [box(column, row, lines) for row, lines in enumerate(boxes)]
    parts += [arrow(*ends) for ends in ARROWS]
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
    print(PICTURE)
