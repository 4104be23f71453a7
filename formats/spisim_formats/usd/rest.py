"""What of a stage is not read: kinds of prims, and attributes that layers state.

OpenUSD's own accessors say not what was asked of them, so what is read is listed.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from spisim_formats.library.records import Rest, words

#: Kinds that place, group or describe others.
GROUPS = words("Xform Scope Material Shader NodeGraph GeomSubset Camera SkelRoot")
#: Kinds that light does not see.
HARMLESS_KINDS = ("Render", "Physics", "Backdrop", "LightFilter", "PluginLightFilter")
#: Attributes of all, or beginnings of them, that are read or say nothing of what light sees.
READ = (
    *("xformOp", "visibility", "purpose", "extent", "doubleSided", "kind", "ui:", "physics:"),
    *("userProperties:blender:", "material:binding", "primvars:st", "primvars:displayColor"),
    *("collection:", "light:", "normals", "primvars:normals", "proxyPrim", "prototypes", "skel:"),
)
#: Inputs of shaders that are read, or change how pictures repeat.
SHADERS = {
    "UsdPreviewSurface": words("""
diffuseColor metallic roughness opacity opacityThreshold opacityMode ior useSpecularWorkflow
"""),
    "UsdUVTexture": words("file st scale bias sourceColorSpace wrapS wrapT"),
    "UsdPrimvarReader_float2": words("varname"),
}
#: Attributes that are read, by kind.
ROUND = words("radius height axis")
BY_KIND = {
    "Mesh": words("""
points faceVertexCounts faceVertexIndices orientation holeIndices
subsetFamily:materialBind:familyType
"""),
    "Cube": words("size"),
    "Sphere": words("radius"),
    **dict.fromkeys(("Cylinder", "Cone", "Capsule"), ROUND),
    "Plane": words("width length axis"),
    "PointInstancer": words("protoIndices positions orientations orientationsf scales ids"),
    **dict.fromkeys(("", "Xform", "Scope", "SkelRoot"), words("")),
}


def unread_prims(stage: Any) -> Rest:
    """Return kinds of prims, attributes that are stated, and those that vary in time."""
    from pxr import Usd

    rest: Rest = Counter()
    for prim in stage.Traverse():
        kind = str(prim.GetTypeName())
        if kind == "Shader":
            rest += _unread_inputs(prim)
        if kind not in BY_KIND:
            if kind not in GROUPS and not kind.startswith(HARMLESS_KINDS) and "Light" not in kind:
                rest["", kind] += 1
            continue
        for each in prim.GetAuthoredProperties():
            name = str(each.GetName())
            if isinstance(each, Usd.Attribute) and each.GetNumTimeSamples():
                rest[kind or "prims", f"{name} in time"] += 1
            if not (name.startswith(READ) or name in BY_KIND[kind]):
                rest[kind or "prims", name] += 1
    return rest


def _unread_inputs(shader: Any) -> Rest:
    """Return a shader of an unknown kind, or its inputs that are not read."""
    kind = str(shader.GetAttribute("info:id").Get() or "of no info:id")
    if kind not in SHADERS:
        return Counter({("", f"Shader {kind}"): 1})
    inputs = [str(name) for name in shader.GetAuthoredPropertyNames() if name.startswith("inputs:")]
    return Counter((kind, i) for i in inputs if i.removeprefix("inputs:") not in SHADERS[kind])
