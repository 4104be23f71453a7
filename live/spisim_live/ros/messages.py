"""Shots as ROS 2 messages: nested mappings, for any sender or store.

Frames follow REP 103 (x forward, y left, z up; optical ones x right, y down, z forward) and REP
105: map, odom, base_link if poses are known, and from base_link on camera_link,
camera_optical_frame, and spot_0, spot_1, ..., whose x axes are the directions of the ranges. Depth
images follow REP 118: 32FC1, metres along the optical axis, nan if unknown.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.exports import Shot
from reconstruction.exports.pictures import POINT, organised
from reconstruction.exports.poses import OPTICAL_IN_BODY, quaternion_of
from reconstruction.ranging import RANGED

BASE, CAMERA, OPTICAL = "base_link", "camera_link", "camera_optical_frame"
INFRARED = 1
"""radiation_type of sensor_msgs/Range."""
FLOAT32 = 7
"""datatype of sensor_msgs/PointField."""
OK, WARN, ERROR, STALE = range(4)
"""level of diagnostic_msgs/DiagnosticStatus."""
BEAM_SIGMAS = 4.0
"""Full width of a Gaussian beam at 1/e² of its peak, in standard deviations."""
FAULT_COUNTS = (
    *("lost", "late", "corrupted", "refused", "strangers", "dropped", "failed"),
    *("method_failures", "sink_failures"),
)
"""Counts of a stream that should not rise."""


class Message(NamedTuple):
    """A message on a topic; a ``latched`` one also reaches late subscribers."""

    topic: str
    type: str
    fields: Mapping[str, Any]
    latched: bool = False


def static_messages(shot: Shot) -> Iterator[Message]:
    """Poses of camera and fixed spots on the drone, constant within a recording."""
    frames = [
        _transform(shot.stamp_ns, BASE, CAMERA, np.eye(4)),
        _transform(shot.stamp_ns, CAMERA, OPTICAL, OPTICAL_IN_BODY),
    ]
    if not shot.steered:
        frames += _spot_frames(shot)
    yield Message("/tf_static", "tf2_msgs/msg/TFMessage", {"transforms": frames}, latched=True)


def frame_messages(shot: Shot) -> Iterator[Message]:
    """Numbers of a frame: pose, directions of steered spots, ranges, diagnostics."""
    frames = _spot_frames(shot) if shot.steered else []
    if shot.pose is not None:
        body = shot.pose @ OPTICAL_IN_BODY.T
        frames += [
            _transform(shot.stamp_ns, "map", "odom", np.eye(4)),
            _transform(shot.stamp_ns, "odom", BASE, body),
        ]
    if frames:
        yield Message("/tf", "tf2_msgs/msg/TFMessage", {"transforms": frames})
    if shot.ranges is not None:
        for k in range(len(shot.ranges.status)):
            yield Message(f"/camera/spot_{k}/range", "sensor_msgs/msg/Range", _range(shot, k))
    yield _diagnostics(shot.stamp_ns, ranging_status(shot))


def map_messages(shot: Shot) -> Iterator[Message]:
    """Maps of a frame: image, depth map, cloud, and their camera."""
    yield Message("/camera/image", "sensor_msgs/msg/Image", _image(shot, shot.image))
    if shot.optics is not None:
        info = _camera_info(shot)
        yield Message("/camera/camera_info", "sensor_msgs/msg/CameraInfo", info)
        if shot.depth_m is not None:
            depth = _image(shot, shot.depth_m)
            yield Message("/camera/depth/image_rect", "sensor_msgs/msg/Image", depth)
            yield Message("/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo", info)
            yield Message("/camera/points", "sensor_msgs/msg/PointCloud2", _cloud(shot))


def state_message(
    stamp_ns: int, numbers: Mapping[str, Any], before: Mapping[str, Any] | None
) -> Message:
    """State of a stream, by the names of `spisim_live.State`, now and ``before``."""
    risen = [
        name for name in FAULT_COUNTS if numbers[name] > (0 if before is None else before[name])
    ]  # fmt: skip
    level, text = OK, "frames come"
    if risen or numbers["trouble"]:
        level, text = WARN, numbers["trouble"] or f"more frames are {', '.join(risen)}"
    if not np.isfinite(numbers["age_s"]):
        level, text = STALE, numbers["trouble"] or "no frame yet"
    values = {name: f"{value}" for name, value in numbers.items() if name != "trouble"}
    return _diagnostics(stamp_ns, _status("spisim: stream", level, text, values))


def _spot_frames(shot: Shot) -> list[dict[str, Any]]:
    return [
        _transform(shot.stamp_ns, OPTICAL, f"spot_{k}", along(direction))
        for k, direction in enumerate(() if shot.spots is None else shot.spots.directions)
    ]


def along(direction: Floats) -> Floats:
    """Pose (4, 4) at the origin of an optical frame whose x axis is a direction (3,)."""
    forward = direction / np.linalg.norm(direction)
    up = np.cross(forward, (-1.0, 0.0, 0.0))  # x right, y down: left is -x
    up /= np.linalg.norm(up)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([forward, np.cross(up, forward), up])
    return pose


def _header(stamp_ns: int, frame: str) -> dict[str, Any]:
    seconds, nanoseconds = divmod(stamp_ns, 10**9)
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame}


def _transform(stamp_ns: int, parent: str, child: str, pose: Floats) -> dict[str, Any]:
    """Pose (4, 4) of the child in the parent."""
    translation = dict(zip("xyz", pose[:3, 3].tolist(), strict=True))
    rotation = dict(zip("xyzw", quaternion_of(pose[:3, :3]).tolist(), strict=True))
    return {
        "header": _header(stamp_ns, parent),
        "child_frame_id": child,
        "transform": {"translation": translation, "rotation": rotation},
    }


def _image(shot: Shot, values: NDArray[np.float32]) -> dict[str, Any]:
    height, width = shot.shape
    return {
        "header": _header(shot.stamp_ns, OPTICAL),
        "height": height,
        "width": width,
        "encoding": "32FC1",
        "is_bigendian": 0,
        "step": 4 * width,
        "data": values.astype("<f4").tobytes(),
    }


def _camera_info(shot: Shot) -> dict[str, Any]:
    height, width = shot.shape
    matrix = shot.intrinsics.matrix
    return {
        "header": _header(shot.stamp_ns, OPTICAL),
        "height": height,
        "width": width,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "k": matrix.ravel().tolist(),
        "r": np.eye(3).ravel().tolist(),
        "p": np.column_stack([matrix, np.zeros(3)]).ravel().tolist(),
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def _cloud(shot: Shot) -> dict[str, Any]:
    height, width = shot.shape
    points = organised(shot)
    names = POINT.names or ()
    return {
        "header": _header(shot.stamp_ns, OPTICAL),
        "height": height,
        "width": width,
        "fields": [
            {"name": name, "offset": 4 * k, "datatype": FLOAT32, "count": 1}
            for k, name in enumerate(names)
        ],
        "is_bigendian": False,
        "point_step": POINT.itemsize,
        "row_step": width * POINT.itemsize,
        "data": points.tobytes(),
        "is_dense": bool(np.isfinite(points["z"]).all()),
    }


def _range(shot: Shot, spot: int) -> dict[str, Any]:
    """Range message of a spot: nan without a range, as no signal in fog does not mean free space.

    "too close" is -inf (cf. REP 117); a variance of 0 means unknown.
    """
    assert shot.ranges is not None
    status = shot.ranges.status[spot]
    range_m, variance = np.nan, 0.0
    if status in RANGED:
        range_m, variance = shot.ranges.range_m[spot], shot.ranges.sigma_m[spot] ** 2
    elif status == "too close":
        range_m = -np.inf
    divergence = np.nan if shot.spots is None else shot.spots.beam_divergence_rad
    return {
        "header": _header(shot.stamp_ns, f"spot_{spot}"),
        "radiation_type": INFRARED,
        "field_of_view": float(BEAM_SIGMAS * divergence) if np.isfinite(divergence) else 0.0,
        "min_range": 0.0,
        "max_range": float("inf"),
        "range": float(range_m),
        "variance": float(variance),
    }


def ranging_status(shot: Shot) -> dict[str, Any]:
    """Diagnostics of the ranging: status of the spots, fog, warnings."""
    values: dict[str, str] = {}
    level, message = OK, "no time of flight"
    if shot.ranges is not None:
        ranged = int(shot.ranges.valid.sum())
        message = f"{ranged} of {len(shot.ranges.status)} spots have a range"
        level = OK if ranged == len(shot.ranges.status) else WARN if ranged else ERROR
        values |= {f"spot {k}": status for k, status in enumerate(shot.ranges.status)}
        if shot.ranges.fog is not None:
            values["fog: extinction, 1/m"] = f"{shot.ranges.fog.extinction_per_m:.6g}"
        if shot.ranges.visibility is not None:
            for name, each in shot.ranges.visibility._asdict().items():
                values[f"visibility: {name}"] = f"{each:.6g}"
    if shot.warnings:
        level = max(level, WARN)
        values |= {f"warning {k}": text for k, text in enumerate(shot.warnings, 1)}
    return _status("spisim: ranging", level, message, values)


def _status(name: str, level: int, text: str, values: Mapping[str, str]) -> dict[str, Any]:
    return {
        "level": level,
        "name": name,
        "message": text,
        "hardware_id": "spisim",
        "values": [{"key": key, "value": value} for key, value in values.items()],
    }


def _diagnostics(stamp_ns: int, status: Mapping[str, Any]) -> Message:
    fields = {"header": _header(stamp_ns, ""), "status": [status]}
    return Message("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", fields)
