"""Cranes of a quay of any height, each with a point to look at."""

from collections.abc import Callable

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import SceneBuilder
from spisim_worlds.parts.lattice import TRIANGLE, boom
from spisim_worlds.parts.shapes import Mesh, bars, block, lathe, moved, rod, union


def _hook(x: float, y: float, high: float, low: float) -> Mesh:
    """Ropes, block and hook, with a load or without."""
    ropes = bars([[(x + s * 0.15, y, low), (x + s * 0.1, y, high)] for s in (-1, 1)], 0.012, 6)
    return union(
        [
            ropes,
            block((0.5, 0.25, 0.7), (x, y, low - 0.3)),
            rod((x, y, low - 1.0), (x, y, low - 0.6), 0.06, 8),
        ]
    )


def _tower_crane(
    builder: SceneBuilder, rng: np.random.Generator, tall: float, rails_m: float
) -> dict[str, Floats]:
    """A mast with a jib that turns on top."""
    x, y = rng.uniform(-20, 20), rng.uniform(-9, -3)
    angle = rng.uniform(0, 2 * np.pi)
    out = np.array([np.cos(angle), np.sin(angle), 0])
    foot, head = np.array([x, y, 0]), np.array([x, y, tall])
    reach = rng.uniform(15, 35)
    parts = [boom(foot, head, (0.7, 0.7), int(tall / 1.5), 0.07)]
    parts.append(
        boom(head, head + reach * out + (0, 0, 0.5), (0.7, 0.5), int(reach / 1.2), 0.06, TRIANGLE)
    )
    parts.append(boom(head, head - 0.35 * reach * out, (0.7, 0.7), 6, 0.06))
    peak = head + np.array([0, 0, 4.0])
    stays = [[peak, head + 0.7 * reach * out], [peak, head - 0.3 * reach * out]]
    stays += [[head + 0.5 * s * out, peak] for s in (-1, 1)]
    load = head + rng.uniform(0.4, 0.9) * reach * out
    builder.mesh(
        "crane",
        "steel-painted",
        union(
            [
                *parts,
                bars(stays, 0.04, 6),
                _hook(load[0], load[1], tall, rng.uniform(0.3, 0.8) * tall),
            ]
        ),
    )
    ballast = head - 0.3 * reach * out - np.array([0, 0, 1.0])
    builder.mesh("counterweight", "concrete", block((1.4, 1.4, 2.2), ballast))
    builder.mesh(
        "crane cab", "glass-painted-back", block((1.4, 1.4, 1.9), head + 1.3 * out - (0, 0, 1.2))
    )
    along = rng.random() < 0.5
    position = (
        head + rng.uniform(0.1, 0.6) * reach * out
        if along
        else foot + rng.uniform(0.3, 0.95) * (head - foot)
    )
    return {"crane": position}


def _portal_crane(
    builder: SceneBuilder, rng: np.random.Generator, tall: float, rails_m: float
) -> dict[str, Floats]:
    """Add a bridge on legs that run on rails to both sides."""
    x, wide = rng.uniform(-20, 20), rng.uniform(10, 22)
    y0, y1 = -1.5 - wide, -1.5
    legs = [
        boom((x + s * 3, y, 0.6), (x + s * 0.8, y, tall), (0.5, 0.4), int(tall / 1.6), 0.08)
        for s in (-1, 1)
        for y in (y0, y1)
    ]
    beam = boom(
        (x, y0 - 4, tall + 0.6), (x, y1 + 9, tall + 0.6), (0.8, 0.8), int(wide / 1.3) + 8, 0.09
    )
    wheels = [block((1.2, 0.5, 0.8), (x + s * 3, y, 0.4)) for s in (-1, 1) for y in (y0, y1)]
    trolley = block((1.8, 1.6, 0.9), (x, rng.uniform(y0, y1), tall - 0.6))
    hook = _hook(x, float(trolley.centroid[1]), tall - 0.8, rng.uniform(0.3, 0.8) * tall)
    builder.mesh(
        "crane",
        str(rng.choice(["steel-painted", "steel-rusty"])),
        union([*legs, beam, *wheels, trolley, hook]),
    )
    rails = [block((2 * rails_m, 0.12, 0.1), (0, y, 0.05)) for y in (y0, y1)]
    builder.mesh("crane rails", "steel-rusty", union(rails))
    return {
        "crane": np.array(
            [x, y1 if rng.random() < 0.5 else rng.uniform(y0, y1), tall * rng.uniform(0.5, 1.0)]
        )
    }


def _jib_crane(
    builder: SceneBuilder, rng: np.random.Generator, tall: float, rails_m: float
) -> dict[str, Floats]:
    """A boom that rises from a body on the quay."""
    x, y, low = rng.uniform(-18, 18), rng.uniform(-8, -3), 0.5 * tall
    angle, lift = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(30, 70))
    out = np.array([np.cos(angle), np.sin(angle), 0])
    head = np.array([x, y, low])
    tip = head + 1.1 * tall * (np.cos(lift) * out + np.sin(lift) * np.array([0, 0, 1]))
    jib = boom(head, tip, (0.6, 0.25), int(tall / 1.1), 0.06)
    stays = bars([[head - 2 * out + (0, 0, 3), tip], [head - 2 * out + (0, 0, 3), head]], 0.04, 6)
    body = lathe([(0, 0), (1.3, 0), (0.9, low), (0, low)], 16)
    cab = block((2.4, 2.2, 2.4), head - 0.6 * out)
    hook = _hook(tip[0], tip[1], tip[2], rng.uniform(0.3, 0.7) * tip[2])
    builder.mesh("crane", "steel-painted", union([moved(body, (x, y, 0)), jib, stays, cab, hook]))
    return {"crane": head + rng.uniform(0.2, 0.9) * (tip - head)}


def _no_crane(
    builder: SceneBuilder, rng: np.random.Generator, tall: float, rails_m: float
) -> dict[str, Floats]:
    """Add nothing."""
    return {}


CRANES: dict[
    str, Callable[[SceneBuilder, np.random.Generator, float, float], dict[str, Floats]]
] = {"tower": _tower_crane, "portal": _portal_crane, "jib": _jib_crane, "none": _no_crane}
"""Functions by name that add a crane, given its height and half the length of rails in m."""
