"""A family of scenes: a closet's back wall with a box before it."""

from spisim.scene.families import Family, Parameters, SceneBuilder, drawn


class ClosetParameters(Parameters):
    """How deep it is."""

    depth_m: float = drawn(2.0, 4.0, "to the back wall")


def build(parameters, rng):
    builder = SceneBuilder(position_m=(0.0, 0.0, 1.5), look_at_m=(4.0, 0.0, 1.5), sky_klx=0.5)
    builder.box("back wall", "plaster", (0.02, 6.0, 6.0), (parameters.depth_m, 0.0, 1.5))
    builder.box("box", "cardboard", (0.3, 0.4, 0.4), (parameters.depth_m - 0.6, 0.1, 1.4))
    return builder


FAMILY = Family("a closet", ClosetParameters, build)
