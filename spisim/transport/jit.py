"""Names for the types of Dr.Jit and Mitsuba values that the transport passes around.

The class behind a name depends on the variant that is active at run time, and the stubs mix the
types of several variants. To a type checker they are all `Any`: the names state the kind of value,
one per lane unless noted.
"""

from typing import Any, TypeAlias

Float: TypeAlias = Any
Int: TypeAlias = Any
UInt: TypeAlias = Any
Bool: TypeAlias = Any
Point2: TypeAlias = Any
Point: TypeAlias = Any
Vector: TypeAlias = Any
Frame: TypeAlias = Any
Matrix: TypeAlias = Any  # mi.Transform4f or mi.Matrix3f
Ray: TypeAlias = Any
Hit: TypeAlias = Any  # mi.SurfaceInteraction3f
Color: TypeAlias = Any  # of one wavelength
Sampler: TypeAlias = Any  # of Mitsuba, or `Points`
Object: TypeAlias = Any  # any other object of Mitsuba, the same for all lanes
