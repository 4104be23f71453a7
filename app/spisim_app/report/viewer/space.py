"""The 3D view: the scene, the drone with its field, spots, and point clouds."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.depth import pixel_rays
from reconstruction.ranging import RANGED
from reconstruction.result import Result
from spisim.scene import Scene, SceneObject
from spisim_app.report.style import spot_looks
from spisim_app.report.viewer.views import View

DRONE, POINTS = "world/drone", "world/points"
CLOUD, TRUTH, REMEMBERED = (255, 140, 40), (90, 200, 120), (250, 250, 250)
POINT_PX, SPOT_PX = 2.0, 6.0
#: Length of the drawn field of the projector.
FIELD_M = 1.0
SIGMAS = 3.0
NO_RANGE = "no range"


class Space:
    """Draws into a stream, and remembers its current scene."""

    def __init__(self, rerun: Any, stream: Any) -> None:
        self._rr = rerun
        self._stream = stream
        self._text: str | None = None
        stream.log("world", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def draw(self, view: View) -> None:
        """Draw a frame."""
        if view.scene is not None:
            self._draw_scene(view.scene, view.since_s)
        self._draw_drone(view)
        self._draw_clouds(view)
        self._draw_points(view)
        if view.shot.ranges is not None and view.shot.spots is not None:
            self._draw_spots(view)

    def _draw_scene(self, scene: Scene, since_s: float) -> None:
        new = scene.text != self._text
        if new and self._text is not None:
            self._stream.log("world/scene", self._rr.Clear(recursive=True))
        self._text = scene.text
        for number, thing in enumerate(scene.objects):
            if new or thing.moves:
                name = f"{number:03d} {thing.name}"
                self._stream.log(["world", "scene", name], self._mesh(thing.at(since_s)))

    def _mesh(self, thing: SceneObject) -> Any:
        """Return flat faces, grey by the reflectance at the laser wavelength."""
        mesh: trimesh.Trimesh = thing.mesh
        corners = mesh.vertices[mesh.faces].reshape(-1, 3)
        grey = round(255 * float(np.clip(np.sqrt(thing.material.reflectance), 0, 1)))
        return self._rr.Mesh3D(
            vertex_positions=corners.astype(np.float32),
            triangle_indices=np.arange(len(corners), dtype=np.uint32).reshape(-1, 3),
            vertex_normals=np.repeat(mesh.face_normals, 3, axis=0).astype(np.float32),
            albedo_factor=(grey, grey, grey, 255),
        )

    def _draw_drone(self, view: View) -> None:
        rr, shot = self._rr, view.shot
        pose = np.eye(4) if shot.pose is None else shot.pose
        transform = rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])
        self._stream.log(DRONE, transform)
        body = rr.Boxes3D(half_sizes=[0.15, 0.04, 0.15], colors=[(240, 240, 240)])
        self._stream.log(f"{DRONE}/body", body)
        if shot.optics is None:
            return
        height, width = shot.shape
        # Rerun counts pixels from a corner of the image
        matrix = shot.intrinsics.matrix.copy()
        matrix[:2, 2] += 0.5
        field = rr.Pinhole(
            image_from_camera=matrix,
            resolution=[width, height],
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=FIELD_M,
            color=(255, 211, 77),
        )
        self._stream.log(f"{DRONE}/projector", field)

    def _draw_clouds(self, view: View) -> None:
        if view.shot.optics is None:
            return
        rays = pixel_rays(view.shot.optics, view.shot.shape)
        maps = {"cloud": (view.shot.depth_m, CLOUD)}
        if view.truth is not None:
            maps["truth"] = (view.truth.depth_m, TRUTH)
        for name, (depth_m, colour) in maps.items():
            if depth_m is None:
                self._stream.log(f"{DRONE}/{name}", self._rr.Clear(recursive=False))
                continue
            points = (rays * depth_m[..., None])[np.isfinite(depth_m)]
            points = self._rr.Points3D(
                points.astype(np.float32),
                colors=[colour],
                radii=self._rr.Radius.ui_points(POINT_PX),
            )
            self._stream.log(f"{DRONE}/{name}", points)

    def _draw_points(self, view: View) -> None:
        """Draw the points that the default depth method remembers, in the world."""
        name, pose = next(iter(view.result.depths), ""), view.shot.pose
        points_m = view.result.points_m.get(name, np.zeros((0, 3)))
        if pose is not None:
            points_m = points_m @ pose[:3, :3].T + pose[:3, 3]
        radii = self._rr.Radius.ui_points(SPOT_PX)
        points = self._rr.Points3D(points_m.astype(np.float32), colors=[REMEMBERED], radii=radii)
        self._stream.log(POINTS, points)

    def _draw_spots(self, view: View) -> None:
        """Draw beams up to the measured ranges, bars of three sigma, and the true ends."""
        rr = self._rr
        assert view.shot.ranges is not None
        assert view.shot.spots is not None
        range_m, sigma_m = view.shot.ranges.range_m, view.shot.ranges.sigma_m
        directions, valid = view.shot.spots.directions, view.shot.ranges.valid
        colours = rgb_of_spots(len(valid))
        ends = directions[valid] * range_m[valid, None]
        beams = [[(0.0, 0.0, 0.0), end] for end in ends.tolist()]
        self._stream.log(f"{DRONE}/spots/beams", rr.LineStrips3D(beams, colors=colours[valid]))
        points = rr.Points3D(
            ends,
            colors=colours[valid],
            radii=rr.Radius.ui_points(SPOT_PX),
            labels=[words for words, is_in in zip(spot_words(view.result), valid, strict=True)
                    if is_in],
        )  # fmt: skip
        self._stream.log(f"{DRONE}/spots/measured", points)
        span = SIGMAS * sigma_m[valid, None] * directions[valid]
        bars = np.stack([ends - span, ends + span], axis=1).tolist()
        sigmas = rr.LineStrips3D(
            bars, colors=colours[valid], radii=rr.Radius.ui_points(SPOT_PX / 2)
        )
        self._stream.log(f"{DRONE}/spots/sigma", sigmas)
        if view.truth is not None:
            true = (directions * view.truth.spot_range_m[:, None])[
                np.isfinite(view.truth.spot_range_m)
            ]
            there = rr.Points3D(true, colors=[TRUTH], radii=rr.Radius.ui_points(SPOT_PX))
            self._stream.log(f"{DRONE}/spots/truth", there)


def rgb_of_spots(count: int) -> NDArray[np.uint8]:
    """Return colours (count, 3) as in the reports."""
    names = [name for name, _ in spot_looks(count)]
    return np.array([[int(name[k : k + 2], 16) for k in (1, 3, 5)] for name in names], np.uint8)


def spot_words(result: Result) -> list[str]:
    """Describe the result of each spot."""
    ranges = result.ranges
    if ranges is None:
        return []
    pairs: Floats = np.stack([ranges.range_m, ranges.sigma_m], axis=1)
    return [
        f"spot {k}: {range_m:.3f} ± {sigma_m:.3f} m" if status in RANGED else f"spot {k}: {status}"
        for k, ((range_m, sigma_m), status) in enumerate(zip(pairs, ranges.status, strict=True))
    ]
