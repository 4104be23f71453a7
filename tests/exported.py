"""Captures with a scene to export, and readers of formats that share no code with the writers."""

import json
from dataclasses import replace

import numpy as np

SCENE = """
name: hall
drone: {position_m: [1, 2, 3], look_at_m: [2, 3, 2.5], velocity_m_s: [15, 0, 0],
        angular_velocity_deg_s: [0, 0, 90]}
objects: [{name: wall, shape: box, size_m: [0.1, 8, 8], material: concrete, translate_m: [9, 9, 0]}]
"""


def with_scene(capture, text=SCENE):
    return replace(capture, provenance=replace(capture.provenance, scene=text))


def read_pcd(content):
    """Points of a binary PCD 0.7 by their fields, and its viewpoint."""
    header, _, data = content.partition(b"DATA binary\n")
    lines = [line.split() for line in header.decode().splitlines() if not line.startswith("#")]
    fields = {words[0]: words[1:] for words in lines}
    kinds = {("F", "4"): "<f4", ("F", "8"): "<f8", ("U", "4"): "<u4", ("U", "1"): "u1"}
    types = [kinds[pair] for pair in zip(fields["TYPE"], fields["SIZE"], strict=True)]
    assert fields["VERSION"] == ["0.7"]
    assert set(fields["COUNT"]) == {"1"}
    points = np.frombuffer(data, list(zip(fields["FIELDS"], types, strict=True)))
    width, height = int(fields["WIDTH"][0]), int(fields["HEIGHT"][0])
    assert len(points) == int(fields["POINTS"][0]) == width * height
    return points.reshape(height, width), np.array(fields["VIEWPOINT"], float)


def nerf_points(folder, number, depth_m):
    """World points of a frame of transforms.json, as nerfstudio finds them from depth."""
    fields = json.loads((folder / "transforms.json").read_text())
    x, y = np.meshgrid(np.arange(fields["w"]) + 0.5, np.arange(fields["h"]) + 0.5)
    across, up = (x - fields["cx"]) / fields["fl_x"], -(y - fields["cy"]) / fields["fl_y"]
    rays = np.stack([across, up, -np.ones_like(x)], axis=-1)
    pose = np.array(fields["frames"][number]["transform_matrix"])
    return (rays * depth_m[..., None]) @ pose[:3, :3].T + pose[:3, 3]
