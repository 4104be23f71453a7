"""URDF robots (.urdf): visuals of their links, with joints in zero position.

https://wiki.ros.org/urdf/XML. Visuals are converted to SDFormat, whose elements are URDF's
attributes.
"""

from functools import partial
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene.pose import pose_matrix
from spisim_formats.library.content import Content, Part
from spisim_formats.library.files import Folders, quoted, read_bytes
from spisim_formats.library.frames import Frames
from spisim_formats.library.records import (
    RecordedElement,
    mark_all,
    sub_element,
    unread_elements,
    words,
)
from spisim_formats.library.units import number_or
from spisim_formats.library.xml import numbers, parse_lenient_xml
from spisim_formats.sdf.visual import Visuals

#: What light does not see, and of joints what does not place links.
HARMLESS = words("""
robot/material robot@name robot@version link@type material@name visual@name joint@type axis
calibration collision dynamics inertial limit mimic safety_controller sensor transmission
""")


@np.errstate(all="ignore")  # poses are checked later to be finite
def read_urdf(path: Path, folders: Folders) -> Content:
    """Read the visuals of a robot, in metres, z up, with all joints at zero.

    Elements that cannot be read or have dangling references are left out with a note. Raises
    InputError if nothing is left.
    """
    content = Content(unit_why="URDF is in metres", up_why="ROS has z up (REP 103)")
    root = parse_lenient_xml(read_bytes(path), path, content.note)
    if root.tag != "robot":
        raise InputError(f"{path}: is no URDF: its root is <{root.tag}>, not <robot>")
    if any(element.tag.startswith("{http://www.ros.org/wiki/xacro}") for element in root.iter()):
        raise InputError(f"{path}: has macros (xacro); `xacro {path.name} > robot.urdf` fills them")
    content.records.append((path.name, partial(unread_elements, root, HARMLESS)))
    visuals = Visuals(folders, content)
    frames = _frames(root, path, content)
    colors = {row.get("name", ""): row for row in root.findall("material")}
    for link in root.findall("link"):
        name = link.get("name", "")
        for visual in link.findall("visual"):
            what = f"link {quoted(name)}"
            with content.leaving_out(what, partial(mark_all, visual)):
                at_link = frames.pose(name) @ _origin(visual, what)
                described = _as_sdf(visual, colors)
                for part in visuals.read(described, path, what):
                    title = " ".join(filter(None, (name, visual.get("name", ""))))
                    content.add(Part(title, part.geometry, at_link @ part.to_world, part.surface))
                content.records.append((path.name, partial(unread_elements, described, HARMLESS)))
    content.check_not_empty(path, "has no visuals; collision shapes are not read")
    return content


def _frames(root: Element, path: Path, content: Content) -> Frames:
    """Return links by name; those without a joint are at the origin."""
    frames = Frames("world", path.name)
    poses: dict[str, tuple[Floats, str] | None] = {}
    for joint in root.findall("joint"):
        what = f"{path.name}: joint {quoted(joint.get('name', ''))}"
        parent, child = joint.find("parent"), joint.find("child")
        moved = "" if child is None else child.get("link", "")
        poses[moved] = None  # unknown unless the joint can be read
        with content.leaving_out(what):
            if parent is None or child is None:
                raise InputError(f"{what}: needs a parent and a child")
            poses[moved] = (_origin(joint, what), parent.get("link", ""))
    for link in root.findall("link"):
        name = link.get("name", "")
        pose = poses.get(name, (np.eye(4), ""))
        if name != "world" and pose is not None:
            with content.leaving_out(f"{path.name}: link {quoted(name)}"):
                frames.add(name, *pose)
    return frames


def _origin(element: Element, what: str) -> Floats:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    angles = numbers(origin.get("rpy", "0 0 0"), 3, f"{what}: rpy")
    return pose_matrix(np.degrees(angles), numbers(origin.get("xyz", "0 0 0"), 3, f"{what}: xyz"))


def _as_sdf(visual: Element, colors: dict[str, Element]) -> Element:
    """Return a visual of SDFormat without a pose."""
    made = RecordedElement("visual")
    geometry = sub_element(made, "geometry")
    for shape in visual.findall("geometry/*"):
        row = sub_element(geometry, shape.tag)
        for name in shape.keys():  # noqa: SIM118
            sub_element(row, "uri" if name == "filename" else name).text = shape.get(name)
    given = visual.find("material")
    if given is not None:
        name = given.get("name", "")
        material = sub_element(made, "material")
        sub_element(sub_element(material, "script"), "name").text = name
        own = any(given.find(each) is not None for each in ("color", "texture"))
        described = given if own else colors.get(name, given)
        color = described.find("color")
        if color is not None:
            rgba = color.get("rgba", "")
            sub_element(material, "diffuse").text = rgba
            if alpha := rgba.split()[3:]:
                transparency = 1 - number_or(alpha[0], 1.0, "rgba")
                sub_element(made, "transparency").text = f"{transparency:.6g}"
        texture = described.find("texture")
        if texture is not None:
            sub_element(material, "albedo_map").text = texture.get("filename", "")
    return made
