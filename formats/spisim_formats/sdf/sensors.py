"""An instrument as sensors simulated by Gazebo: a depth camera and lidar rays (SDFormat 1.9).

Gazebo simulates only their geometry: no fog, and no noise of a single-pixel camera. They serve to
develop downstream software with the messages and poses of the real instrument.
"""

import math
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from spisim.instrument.model import Instrument
from spisim.scene.assemble import OPTICAL_FROM_BODY

MODEL = "spisim_drone"
NEAREST_M, FARTHEST_M = 0.1, 100.0
#: Systems of Gazebo (gz-sim 8 and later) for a world with sensors: file and class.
SYSTEMS = {
    "physics": "Physics",
    "user-commands": "UserCommands",
    "scene-broadcaster": "SceneBroadcaster",
    "sensors": "Sensors",
}


def sensor_elements(instrument: Instrument, drone_pose: Floats) -> list[Element]:
    """Return elements of a world: the systems for sensors, and a model that carries them.

    `drone_pose` (4, 4) is world from optical frame. The camera has the projector's field and
    pixels, and each ray a laser's direction, up to its unambiguous range. Topics are those of
    `spisim_live.ros.messages`.
    """
    systems = [
        Element("plugin", filename=f"gz-sim-{file}-system", name=f"gz::sim::systems::{name}")
        for file, name in SYSTEMS.items()
    ]
    SubElement(systems[-1], "render_engine").text = "ogre2"
    model = Element("model", name=MODEL)
    SubElement(model, "static").text = "true"
    SubElement(model, "pose").text = _pose(drone_pose @ OPTICAL_FROM_BODY)
    link = SubElement(model, "link", name="base_link")
    rate_hz = 1 / instrument.frame_time_s
    far_m = min(FARTHEST_M, instrument.ranging.tof.unambiguous_range_m)
    _add_camera(link, instrument, rate_hz)
    for number, (azimuth, elevation) in enumerate(instrument.ranging.lasers.directions_deg):
        _add_ray(link, number, (azimuth, elevation), rate_hz, far_m)
    return [*systems, model]


def _add_camera(link: Element, instrument: Instrument, rate_hz: float) -> None:
    projector = instrument.imaging.projector
    sensor = _sensor(link, "camera", "rgbd_camera", rate_hz, "camera")
    camera = SubElement(sensor, "camera")
    SubElement(camera, "optical_frame_id").text = "camera_optical_frame"
    SubElement(camera, "horizontal_fov").text = repr(math.radians(projector.fov_deg))
    image = SubElement(camera, "image")
    SubElement(image, "width").text = str(projector.shape[1])
    SubElement(image, "height").text = str(projector.shape[0])
    SubElement(image, "format").text = "R8G8B8"
    clip = SubElement(camera, "clip")
    SubElement(clip, "near").text = repr(NEAREST_M)
    SubElement(clip, "far").text = repr(FARTHEST_M)


def _add_ray(
    link: Element, number: int, direction_deg: tuple[float, float], rate_hz: float, far_m: float
) -> None:
    azimuth, elevation = direction_deg
    sensor = _sensor(link, f"spot_{number}", "gpu_lidar", rate_hz, f"camera/spot_{number}/scan")
    # SDFormat: positive pitch looks down, positive yaw to the left
    turn = [0.0, -math.radians(elevation), -math.radians(azimuth)]
    SubElement(sensor, "pose").text = _numbers([0.0, 0.0, 0.0, *turn])
    SubElement(sensor, "gz_frame_id").text = f"spot_{number}"
    lidar = SubElement(sensor, "lidar")
    scan = SubElement(lidar, "scan")
    for axis in ("horizontal", "vertical"):
        row = SubElement(scan, axis)
        for name in ("samples", "resolution"):
            SubElement(row, name).text = "1"
        for name in ("min_angle", "max_angle"):
            SubElement(row, name).text = "0"
    row = SubElement(lidar, "range")
    SubElement(row, "min").text = repr(NEAREST_M)
    SubElement(row, "max").text = repr(far_m)
    SubElement(row, "resolution").text = "0.001"


def _sensor(link: Element, name: str, kind: str, rate_hz: float, topic: str) -> Element:
    sensor = SubElement(link, "sensor", name=name, type=kind)
    SubElement(sensor, "topic").text = topic
    SubElement(sensor, "update_rate").text = f"{rate_hz:.6g}"
    SubElement(sensor, "always_on").text = "true"
    return sensor


def _pose(matrix: Floats) -> str:
    angles = Rotation.from_matrix(matrix[:3, :3]).as_euler("xyz")
    return _numbers([*matrix[:3, 3], *angles])


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
