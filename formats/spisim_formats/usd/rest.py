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
    *("userProperties:", "material:binding", "primvars:st", "primvars:displayColor"),
    *("collection:", "light:", "normals", "primvars:normals"),
)
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
    rest: Rest = Counter()
    for prim in stage.Traverse():
        kind = str(prim.GetTypeName())
        if kind not in BY_KIND:
            if kind not in GROUPS and not kind.startswith(HARMLESS_KINDS) and "Light" not in kind:
                rest["", kind] += 1
            continue
        for attribute in prim.GetAuthoredAttributes():
            name = str(attribute.GetName())
            if attribute.GetNumTimeSamples():
                rest[kind or "prims", f"{name} in time"] += 1
            if not (name.startswith(READ) or name in BY_KIND[kind]):
                rest[kind or "prims", name] += 1
    return rest
