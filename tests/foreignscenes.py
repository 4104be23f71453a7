"""Foreign documents that use most of what the import reads, and the files that they refer to."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from foreign import MILLIMETRES_Y_UP, TRIANGLE, collada, glb, tetrahedron

OBJ = """mtllib a.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 2
vt 0 0
vn 0 0 1
o X
usemtl red brick
f 1/1 2/1 3/1 4/1
f 1//1 2 3
o Y
g part
usemtl steel
f 1/1/1 2/1/1 5/1/1
f 3 4 5
l 1 2
p 1
"""
MTL = "newmtl red brick\nKd 0.9 0.9 0.9\nmap_Kd a.png\nnewmtl steel\nKd 0.1 0.1 0.1\n"

SDF = """<sdf version="1.9"><world name="w">
<frame name="f" attached_to="m"><pose relative_to="world">1 2 3 0 0 0</pose></frame>
<frame name="g"><pose relative_to="f" rotation_format="quat_xyzw">0 0 0 0 0 0 1</pose></frame>
<light name="sun" type="directional"/><population name="p"/>
<include><uri>model://chair</uri><name>one</name><pose relative_to="g">4 0 0 0 0 1</pose>
<placement_frame>seat</placement_frame></include>
<include><uri>b.sdf</uri><pose>6 0 0 0 0 0</pose></include>
<model name="m" placement_frame="l"><pose relative_to="f" degrees="true">0 0 0 0 0 90</pose>
<link name="l"><pose>0 0 1 0 0 0</pose>
<visual name="a"><geometry><box><size>1 2 3</size></box></geometry></visual>
<visual name="b"><pose>0 0 1 0 0 0</pose><geometry><cylinder><radius>1</radius><length>2</length>
</cylinder></geometry><material><diffuse>1 1 1 1</diffuse>
<script><name>Gazebo/Wood</name></script><pbr><metal><metalness>0.9</metalness><albedo_map>a.png</albedo_map></metal></pbr></material>
</visual>
<visual name="c"><geometry><mesh><uri>a.obj</uri><submesh><name>X_red brick</name>
<center>true</center></submesh><scale>1 2 -1</scale></mesh></geometry></visual>
<visual name="d"><geometry><mesh><uri>model://chair/chair.ply</uri></mesh></geometry></visual>
<visual name="e"><geometry><plane><normal>0 1 0</normal><size>9 9</size></plane></geometry></visual>
<visual name="i"><transparency>1</transparency><geometry><heightmap/></geometry></visual>
<visual name="j"><geometry><cone><radius>1</radius><length>2</length></cone></geometry></visual>
</link>
<joint name="k" type="fixed"><pose relative_to="l">0 0 0 0 0 0</pose><parent>world</parent>
<child>l</child></joint>
<model name="inner"><link name="l"><visual name="s"><geometry><sphere><radius>1</radius></sphere>
</geometry></visual></link><frame name="x"><pose relative_to="l">0 0 0 0 0 0</pose></frame></model>
</model></world></sdf>"""
CHAIR = """<sdf version="1.9"><model name="chair"><link name="seat"><pose>0 0 1 0 0 0</pose>
<visual name="v"><geometry><box><size>1 1 0.1</size></box></geometry></visual></link></model>
</sdf>"""
LOOP_SDF = """<sdf version="1.9"><model name="loop"><include><uri>loop.sdf</uri></include></model>
</sdf>"""

MITSUBA = """<scene version="3.0.0"><default name="r" value="2"/><default name="s" value="$r $r"/>
<integrator type="path"/><path value="x"/><include filename="b.xml"/>
<bsdf type="twosided" id="walls"><bsdf type="principled" id="inner">
<rgb name="base_color" value="0.5, 0.5, 0.5"/></bsdf></bsdf>
<bsdf type="roughconductor" id="metal"><string name="material" value="Al"/></bsdf>
<texture type="bitmap" id="t"><string name="filename" value="a.png"/></texture>
<bsdf type="diffuse" id="papered"><ref id="t" name="reflectance"/></bsdf>
<sensor type="perspective"><transform name="to_world"><lookat origin="9 9 9" target="0 0 0"
up="0 0 1"/></transform><float name="fov" value="40"/></sensor>
<emitter type="point"><rgb name="intensity" value="#ff00ff"/></emitter>
<shape type="sphere"><float name="radius" value="$r"/><point name="center" x="1" y="2" z="3"/>
<ref id="walls"/><boolean name="flip_normals" value="true"/></shape>
<shape type="cube" id="c"><transform name="to_world"><scale value="2"/><rotate x="1" angle="30"/>
<translate x="1" y="2" z="3"/><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></transform>
<ref id="metal"/></shape>
<shape type="cylinder"><point name="p0" value="0 0 0"/><point name="p1" value="1 1 1"/></shape>
<shape type="disk"><ref id="papered"/></shape><shape type="rectangle"/>
<shape type="obj"><string name="filename" value="a.obj"/><bsdf type="dielectric"/></shape>
<shape type="ply" id="p"><string name="filename" value="a.ply"/></shape></scene>"""
INCLUDED = """<scene version="3.0.0"><shape type="ply">
<string name="filename" value="a.ply"/></shape><default name="r" value="3"/></scene>"""
LOOP_XML = """<scene version="3.0.0"><include filename="loop.xml"/></scene>"""

#: A square of two triangles with indices behind the triangle of `TRIANGLE`.
BINARY = TRIANGLE + np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4").tobytes()
BINARY += struct.pack("<6H", 0, 1, 2, 0, 2, 3) + bytes(4)
GLTF: dict[str, Any] = {
    "asset": {"version": "2.0", "generator": "tests"},
    "extensionsUsed": ["KHR_materials_transmission"],
    "scene": 0,
    "scenes": [{"nodes": [0, 3], "name": "s"}],
    "nodes": [
        {"name": "root", "children": [1, 2], "rotation": [0, 0, 0, 1], "scale": [1, 1, 2]},
        {"mesh": 0, "name": "sheet", "translation": [1, 0, 0]},
        {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1], "skin": 0},
        {"camera": 0, "children": [4]},
        {"mesh": 0},
    ],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
    "meshes": [
        {"name": "sheet", "primitives": [{"attributes": {"POSITION": 0}, "material": 0}]},
        {"primitives": [
            {"attributes": {"POSITION": 1}, "indices": 2, "material": 1, "mode": 4},
            {"attributes": {"POSITION": 1}, "mode": 5},
            {"attributes": {"POSITION": 0}, "mode": 1},
        ]},
    ],
    "materials": [
        {"name": "Concrete.001",
         "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}},
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 1},
         "extensions": {"KHR_materials_transmission": {}}},
    ],
    "textures": [{"source": 0}],
    "images": [{"uri": "a.png"}],
    "skins": [{"joints": [1]}],
    "animations": [{"channels": [], "samplers": []}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 1, "byteOffset": 0, "componentType": 5126, "count": 4, "type": "VEC3",
         "min": [0, 0, 0], "max": [1, 1, 0]},
        {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteLength": 36},
        {"buffer": 0, "byteOffset": 36, "byteLength": 48, "target": 34962},
        {"buffer": 0, "byteOffset": 84, "byteLength": 12},
    ],
    "buffers": [{"byteLength": 100}],
}  # fmt: skip
GLTF_BESIDE = GLTF | {"buffers": [{"byteLength": 100, "uri": "a.bin"}]}
COLLADA = collada(MILLIMETRES_Y_UP, "a.png")


def lay_out(folder: Path) -> None:
    """Put the files beside which the documents lie into a folder."""
    (folder / "chair").mkdir(parents=True)
    config = '<model><sdf version="1.9">chair.sdf</sdf><sdf version="1.4">old.sdf</sdf></model>'
    texts = {
        "a.obj": OBJ, "a.mtl": MTL, "b.sdf": CHAIR, "b.xml": INCLUDED, "a.dae": COLLADA,
        "loop.sdf": LOOP_SDF, "loop.xml": LOOP_XML, "chair/chair.sdf": CHAIR,
        "chair/model.config": config, "a.sdf": SDF, "a.xml": MITSUBA,
    }  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text)
    (folder / "a.bin").write_bytes(BINARY)
    (folder / "a.glb").write_bytes(glb(GLTF, BINARY))
    for name in ("a.ply", "chair/chair.ply"):
        (folder / name).write_bytes(tetrahedron().export(file_type="ply"))
    (folder / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n")
