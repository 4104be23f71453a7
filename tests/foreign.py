"""Files of other programs, as text and bytes, that the tests of the import make for themselves."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from spisim_formats import Import, Options, import_scene
from spisim_formats.format import readers

#: All formats, as the command line reads them.
READERS = readers()

#: glTF's y up to the world's z up.
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

#: A tetrahedron with corners at 0 and 1000, 2000, 3000 mm along x, y, z; y is up.
COLLADA = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset>{asset}</asset>
 <library_images><image id="i"><init_from>{texture}</init_from></image></library_images>
 <library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong>
  <diffuse><color>0.9 0.9 0.9 1</color></diffuse></phong></technique></profile_COMMON></effect>
 </library_effects>
 <library_materials><material id="m" name="Rusty Steel"><instance_effect url="#e"/></material>
 </library_materials>
 <library_geometries><geometry id="g" name="wedge"><mesh>
  <source id="p"><float_array id="pa" count="12">0 0 0 1000 0 0 0 2000 0 0 0 3000</float_array>
   <technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
   <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
  </source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles material="sym" count="4"><input semantic="VERTEX" source="#v" offset="0"/>
   <p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s">
  <node id="a" name="first"><translate>500 0 0</translate><rotate>0 1 0 90</rotate>
   <instance_geometry url="#g"><bind_material><technique_common>
   <instance_material symbol="sym" target="#m"/></technique_common></bind_material>
   </instance_geometry></node>
  <node id="b" name="second"><translate>0 0 -4000</translate><instance_geometry url="#g">
   <bind_material><technique_common><instance_material symbol="sym" target="#m"/>
   </technique_common></bind_material></instance_geometry></node>
 </visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""
MILLIMETRES_Y_UP = '<unit name="millimeter" meter="0.001"/><up_axis>Y_UP</up_axis>'


def collada(asset: str = MILLIMETRES_Y_UP, texture: str = "") -> str:
    """COLLADA text of two tetrahedra that share one geometry."""
    text = COLLADA.format(asset=asset, texture=texture)
    return text if texture else text.replace('<image id="i"><init_from></init_from></image>', "")


def taken(file: Path, **options: Any) -> Import:
    """Import a file into a folder beside it."""
    output = file.parent / "taken" / "scene.yaml"
    return import_scene(file, output, Options(**options))


def written(report: Import) -> trimesh.Trimesh:
    """All meshes of the written scene, in the world, as one."""
    return trimesh.util.concatenate([thing.mesh for thing in report.written.scene.objects])


def corners(mesh: trimesh.Trimesh) -> np.ndarray:
    """Corners of all triangles (3 t, 3), sorted, to compare meshes whatever their order."""
    points = mesh.triangles.reshape(-1, 3)
    return points[np.lexsort(np.round(points, 5).T)]


def assert_same(got: trimesh.Trimesh, expected: trimesh.Trimesh) -> None:
    """Same triangles, volume and bounds within a micrometre."""
    assert len(got.faces) == len(expected.faces)
    np.testing.assert_allclose(got.bounds, expected.bounds, rtol=0, atol=1e-6)
    np.testing.assert_allclose(corners(got), corners(expected), rtol=0, atol=1e-6)
    assert abs(got.volume - expected.volume) <= 1e-6 * max(1.0, expected.area)


def tetrahedron() -> trimesh.Trimesh:
    """The geometry of `COLLADA`, metres, as it stands in the file."""
    points = [[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]]
    return trimesh.Trimesh(points, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], process=False)


def glb(header: dict[str, Any], binary: bytes = b"") -> bytes:
    """A GLB file of a JSON header and a chunk of data."""
    text = json.dumps(header).encode()
    return glb_of_text(text + b" " * (-len(text) % 4), binary)


def glb_of_text(text: bytes, binary: bytes = b"") -> bytes:
    """A GLB file with this text where the JSON header belongs."""
    chunks = struct.pack("<2I", len(text), 0x4E4F534A) + text
    if binary:
        chunks += struct.pack("<2I", len(binary), 0x004E4942) + binary
    return b"glTF" + struct.pack("<2I", 2, 12 + len(chunks)) + chunks


def triangle_header(**changes: Any) -> dict[str, Any]:
    """Header of a glTF file of one triangle of 3 × 3 floats; `changes` replace its fields."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "sheet"}],
        "meshes": [{"name": "sheet", "primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
        **changes,
    }


TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
