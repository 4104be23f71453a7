"""Text of a small scene file, shared by the tests of scene files."""

from collections.abc import Callable

from spisim.scene import Scene

MINIMAL = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], rotate_deg: [0, -90, 0],
     translate_m: [5, 0, 1], material: concrete}
"""

Load = Callable[[str], Scene]


def with_objects(*objects: str) -> str:
    """The same scene with more objects, each told as the inside of a YAML mapping."""
    return MINIMAL + "".join(f"  - {{{item}}}\n" for item in objects)
