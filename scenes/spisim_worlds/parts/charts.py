"""Boards with patterns, one metre across: they stand up in the plane x = 0 and face -x."""

import numpy as np

from spisim_worlds.parts.shapes import Mesh, alike, block, union

#: Distance of the pattern in front of its board.
RELIEF_M = 0.004
THICK_M = 0.03


def chart(rng: np.random.Generator, kind: str, width: float, height: float) -> tuple[Mesh, Mesh]:
    """Return a board of a size in metres, and the pattern on it."""
    board = block((THICK_M, width, height), (THICK_M / 2, 0, 0))
    cells = _CELLS[kind](rng) - (0.5, 0.5, 0, 0)
    cells[:, 2:] = np.maximum(cells[:, 2:], 0.01)
    y, z, wide, high = (cells * np.tile((width, height), 2)).T
    one = block((1, 1, 1), (0, 0, 0))
    size = np.stack([np.full(len(y), RELIEF_M), wide, high], axis=1)
    at = np.stack([np.full(len(y), -RELIEF_M / 2), y, z], axis=1)
    return board, alike(one.vertices * size[:, None] + at[:, None], np.asarray(one.faces))


def _bars(rng: np.random.Generator) -> np.ndarray:
    """Return middle and size (n, 4) of upright or level bars that get narrower."""
    widths = 0.5 ** np.linspace(2.5, 5.5, 9)
    at = np.cumsum(2 * widths) - widths
    at = at / at.max() * 0.9
    level = rng.random() < 0.5
    long = np.full(9, 0.9)
    middle = np.full(9, 0.5)
    return np.stack([middle, at, long, widths] if level else [at, middle, widths, long], axis=1)


def _checks(rng: np.random.Generator) -> np.ndarray:
    n = int(rng.integers(3, 10))
    i, j = np.nonzero(np.indices((n, n)).sum(axis=0) % 2)
    return np.stack([(i + 0.5) / n, (j + 0.5) / n, 0 * i + 1 / n, 0 * i + 1 / n], axis=1)


def _code(rng: np.random.Generator) -> np.ndarray:
    n = int(rng.integers(5, 16))
    i, j = np.nonzero(rng.random((n, n)) < 0.45)
    return np.stack([(i + 0.5) / n, (j + 0.5) / n, 0 * i + 1 / n, 0 * i + 1 / n], axis=1)


def _lines(rng: np.random.Generator) -> np.ndarray:
    """Lines of words, as of a poster."""
    result = []
    for z in np.arange(0.08, 0.95, rng.uniform(0.07, 0.16)):
        y = 0.06
        while y < 0.9:
            wide = min(rng.uniform(0.03, 0.25), 0.94 - y)
            result.append((y + wide / 2, z, wide, rng.uniform(0.02, 0.05)))
            y += wide + 0.03
    return np.array(result)


def _patches(rng: np.random.Generator) -> np.ndarray:
    """Return a few random rectangles."""
    n = int(rng.integers(1, 7))
    size = rng.uniform(0.08, 0.45, (n, 2))
    return np.hstack([size / 2 + rng.random((n, 2)) * (1 - size), size])


_CELLS = {"bars": _bars, "checks": _checks, "code": _code, "lines": _lines, "patches": _patches}
#: Kinds of patterns.
CHARTS = tuple(_CELLS)


def stand(height: float) -> Mesh:
    """Two legs and a foot below a board whose middle is `height` above the floor."""
    legs = [block((0.04, 0.04, height), (THICK_M + 0.02, y, -height / 2)) for y in (-0.15, 0.15)]
    return union([*legs, block((0.5, 0.5, 0.03), (THICK_M, 0, 0.015 - height))])
