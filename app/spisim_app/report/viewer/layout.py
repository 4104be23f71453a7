"""The initial layout of the viewer: 3D view, images, readings and ranges side by side."""

from __future__ import annotations

from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.base.optional import import_optional
from spisim.scene import Scene
from spisim.scene.rays import first_hits

#: Maximum distance of the eye, as a fraction of that from the drone to a wall behind it.
BEFORE_WALL = 0.7
#: Eye and its target in the drone's optical frame: over its right shoulder.
EYE, TARGET = (0.45, -0.4, -1.1), (0.0, 0.0, 3.0)


def layout(pose: Floats, scene: Scene | None) -> Any:
    """Return a Rerun blueprint with the eye behind a drone at a pose (4, 4).

    The pose is world from optical frame. Raises InputError without Rerun.
    """
    rrb = import_optional("rerun.blueprint", "viewer")
    back = EYE if scene is None else _inside(scene, pose)
    eye, target = (pose @ np.array([*point, 1.0]) for point in (back, TARGET))
    looking = rrb.EyeControls3D(
        position=eye[:3], look_target=target[:3], eye_up=-pose[:3, 1], kind=rrb.Eye3DKind.Orbital
    )
    pictures = rrb.Grid(
        *(
            rrb.Spatial2DView(origin=origin, name=name)
            for origin, name in (
                ("images/image", "image"),
                ("images/truth", "true image"),
                ("depth/depth", "depth"),
                ("depth/truth", "true depth"),
            )
        ),
        grid_columns=2,
    )
    readings = rrb.Tabs(
        rrb.Spatial2DView(origin="phasors", name="phasors"),
        rrb.BarChartView(origin="readings/taps", name="taps"),
        rrb.BarChartView(origin="readings/histograms", name="histograms"),
        rrb.BarChartView(origin="readings/patterns", name="patterns"),
        rrb.TensorView(origin="readings/pattern_taps", name="taps of patterns"),
    )
    ranges = rrb.Horizontal(
        rrb.TimeSeriesView(origin="ranges", name="ranges, m"),
        rrb.TextDocumentView(origin="notes", name="notes"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(origin="world", name="space", eye_controls=looking),
                ranges,
                row_shares=[3, 1],
            ),
            rrb.Vertical(pictures, readings, row_shares=[3, 2]),
            column_shares=[3, 2],
        ),
        collapse_panels=True,
    )


def _inside(scene: Scene, pose: Floats) -> tuple[float, float, float]:
    """Return the eye's position in the optical frame, in front of any surface behind the drone."""
    way = pose[:3, :3] @ np.array(EYE)
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    free = float(first_hits(pose[:3, 3], way[None], triangles)[0])
    x, y, z = (min(1.0, BEFORE_WALL * free) * np.array(EYE)).tolist()
    return x, y, z
