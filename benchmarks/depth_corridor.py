"""What benchmarks/depth.py says of the corridor ahead: missed and false obstacles, reliability."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from depth_judging import Judged, Way
from intervals import of_figure

from reconstruction.base.arrays import Floats, Mask
from reconstruction.depth import DISTANCES_M, MIN_FREE, nearest_obstacle_m
from spisim_paper.checks import Check, Table

Groups = Mapping[tuple[str, str], Sequence[Judged]]
"""By group of scenes, and clear or fog."""
CLOSE = 1.25
DISPLAYED = (0.3, 0.5, 0.6, MIN_FREE, 0.8, 0.9, 0.95)
SWEPT = np.unique(np.append(np.linspace(0.02, 0.98, 97), DISPLAYED))
FROM_M = 0.5
"""What is nearer is free in all captures."""
BINS = 10
FALSE, MISSED, RELIABLE = 0.20, 0.05, 0.05
"""False alarms at so many missed, in clear air; mean difference of probability and frequency."""


def rates(true_m: Floats, reported_m: Floats) -> tuple[float, float]:
    """Fractions of the obstacles that are missed, and of the captures with a false alarm."""
    ratio, there = reported_m / true_m, np.isfinite(true_m)
    missed = np.mean(~(ratio[there] <= CLOSE)) if there.any() else np.nan
    return float(missed), float(np.mean(np.isfinite(reported_m) & ~(ratio >= 2 - CLOSE)))


def obstacles(judged: Sequence[Judged], way: Way, swept: Sequence[float]) -> tuple[Floats, Floats]:
    """The nearest ones, true (captures,), and as reported below each probability (n, captures)."""
    true_m = np.array([each.obstacle_m for each in judged])
    reported_m = [[nearest_obstacle_m(each.free[way], p) for each in judged] for p in swept]
    return true_m, np.array(reported_m)


def false_at(true_m: Floats, reported_m: Floats) -> float:
    """Least fraction of false alarms at which no more than MISSED are missed; 1 if at none."""
    points = [rates(true_m, each) for each in reported_m]
    return min((false for missed, false in points if missed <= MISSED), default=1.0)


def roc(groups: Groups, way: Way) -> Table:
    """Missed and false by the probability at which an obstacle is reported."""
    body = []
    for (group, air), judged in groups.items():
        true_m, reported_m = obstacles(judged, way, DISPLAYED)
        displayed = ("{:.3f} / {:.3f}".format(*rates(true_m, each)) for each in reported_m)
        false = false_at(*obstacles(judged, way, SWEPT))
        body.append((group, air, str(len(judged)), *displayed, f"{false:.3f}"))
    columns = ("group", "air", "captures", *(f"{each:g}" for each in DISPLAYED))
    return Table(
        f"Obstacles of `{way[0]}` on the ranges of `{way[1]}`, by the probability of a free "
        "corridor below which one is reported: fraction missed / captures with a false alarm; and "
        f"false alarms at {MISSED:g} missed.",
        (*columns, f"false at {MISSED:g} missed"),
        body,
    )


def corridors(judged: Sequence[Judged], way: Way) -> tuple[Floats, Mask]:
    """The stated probability of a free corridor, and whether it is (captures, distances)."""
    far = DISTANCES_M >= FROM_M
    true_m = np.array([each.obstacle_m for each in judged])
    stated = np.array([each.free[way] for each in judged])
    return stated[:, far], (~(true_m[:, None] <= DISTANCES_M))[:, far]


def binned(stated: Floats, free: Mask) -> Floats:
    """By tenths of the probability that the corridor is free: its mean, what is free, how many."""
    tenth = np.minimum(stated * BINS, BINS - 1).astype(int).ravel()
    count = np.bincount(tenth, minlength=BINS)
    with np.errstate(invalid="ignore"):
        sums = (np.bincount(tenth, each.ravel(), BINS) / count for each in (stated, free))
        return np.array([*sums, count / count.sum()])


def off(stated: Floats, free: Mask) -> float:
    """Mean difference of probability and frequency over tenths, as often as they are stated."""
    mean, fraction_free, fraction = binned(stated, free)
    return float(np.nansum(np.abs(mean - fraction_free) * fraction))


def reliability(groups: Groups, way: Way) -> Table:
    """What is free by what is stated to be."""
    body = []
    for (group, air), judged in groups.items():
        reported = corridors(judged, way)
        stated, free, _ = binned(*reported)
        cells = (
            "–" if np.isnan(pair[0]) else "{:.2f}: {:.2f}".format(*pair)
            for pair in zip(stated, free, strict=True)
        )
        body.append((group, air, *cells, f"{off(*reported):.3f}"))
    tenths = (f"{n / BINS:g}–{(n + 1) / BINS:g}" for n in range(BINS))
    return Table(
        f"Reliability of `{way[0]}`: mean probability that the corridor is free up to a distance, "
        f"and how often it is, over captures and distances from {FROM_M:g} to "
        f"{DISTANCES_M[-1]:g} m, by tenths; and the mean difference, as often as they are stated.",
        ("group", "air", *tenths, "mean difference"),
        body,
    )


def corridor_checks(groups: Groups, way: Way) -> Iterator[Check]:
    """What is promised of families that nothing learned from."""
    for (group, air), judged in groups.items():
        if group == "unseen families":
            where = f"{group}, {air}"
            scenes = [each.scene_name for each in judged]
            stated, free = corridors(judged, way)
            yield Check(
                f"reliability of a free corridor, {where}",
                off(stated, free),
                RELIABLE,
                interval=of_figure(lambda some: off(stated[some], free[some]), scenes),  # noqa: B023
            )
            if air == "clear":
                true_m, reported_m = obstacles(judged, way, SWEPT)
                yield Check(
                    f"false obstacles at {MISSED:g} missed, {where}",
                    false_at(true_m, reported_m),
                    FALSE,
                    interval=of_figure(
                        lambda some: false_at(true_m[some], reported_m[:, some]),  # noqa: B023
                        scenes,
                    ),
                )
