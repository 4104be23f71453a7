"""What a scene file may say of lamps: steady light besides sun and sky, never modulated.

How strong a lamp is stands in one field, in watts within the instrument's band, in front of its
filter, or in lumens: these count as daylight's, with its watts in the band for every lumen.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from spisim.base.config import Name, Number, Positive, Section, Vector


class LampDescription(Section):
    """What lamps of every type have in common: exactly one of the fields `STRENGTHS`."""

    STRENGTHS: ClassVar[tuple[str, ...]]

    name: Name
    """What messages call it; no two lamps share one."""

    @model_validator(mode="after")
    def _one_strength(self) -> LampDescription:
        if len(self.model_fields_set & set(self.STRENGTHS)) != 1:
            one_of = ", ".join(self.STRENGTHS)
            raise PydanticCustomError("lamp", "needs one of {fields}", {"fields": one_of})
        return self

    @property
    def strength(self) -> tuple[str, float]:
        """The field that tells it, and its value."""
        (field,) = self.model_fields_set & set(self.STRENGTHS)
        return field, getattr(self, field)


class AreaLampDescription(LampDescription):
    """An object whose surface shines besides, all over, on the side that its triangles face.

    Equally bright from every direction (Lambertian).
    """

    STRENGTHS = ("radiance_w_per_m2_sr", "power_w", "luminous_flux_lm")

    type: Literal["area"]
    """Told by this word."""
    object: Name
    """Name of the object whose surface shines."""
    radiance_w_per_m2_sr: Positive | None = None
    """Radiance of the surface within the band."""
    power_w: Positive | None = None
    """Power of the whole surface within the band."""
    luminous_flux_lm: Positive | None = None
    """Luminous flux of the whole surface, taken for daylight's."""


class PointLampDescription(LampDescription):
    """A lamp without a size, which shines in all directions alike."""

    STRENGTHS = ("intensity_w_per_sr", "power_w", "luminous_flux_lm")

    type: Literal["point"]
    """Told by this word."""
    position_m: Vector
    """Where it is, world coordinates."""
    intensity_w_per_sr: Positive | None = None
    """Radiant intensity within the band."""
    power_w: Positive | None = None
    """Power in all directions together, within the band."""
    luminous_flux_lm: Positive | None = None
    """Luminous flux, taken for daylight's."""


class SpotLampDescription(LampDescription):
    """A lamp without a size, which shines into a cone about its direction.

    As bright as on its axis up to `beam_deg` from it, three quarters of the cutoff unless given,
    from there on falling in proportion to the angle, to nothing at `cutoff_deg`.
    """

    STRENGTHS = ("intensity_w_per_sr", "power_w", "luminous_flux_lm")

    type: Literal["spot"]
    """Told by this word."""
    position_m: Vector
    """Where it is, world coordinates."""
    direction: Vector
    """Axis of the cone, in which the light goes."""
    cutoff_deg: Annotated[Number, Field(gt=0, le=90)] = 20.0
    """From the axis to where the light ends."""
    beam_deg: Annotated[Number, Field(ge=0, le=90)] | None = None
    """From the axis to where it begins to fall; three quarters of the cutoff without."""
    intensity_w_per_sr: Positive | None = None
    """Radiant intensity on the axis, within the band."""
    power_w: Positive | None = None
    """Power of the whole cone within the band."""
    luminous_flux_lm: Positive | None = None
    """Luminous flux of the whole cone, taken for daylight's."""

    @model_validator(mode="after")
    def _beam_within_cutoff(self) -> SpotLampDescription:
        if self.beam_deg is not None and self.beam_deg > self.cutoff_deg:
            raise PydanticCustomError(
                "lamp",
                "beam_deg {beam} should be at most cutoff_deg, {cutoff}",
                {"beam": self.beam_deg, "cutoff": self.cutoff_deg},
            )
        return self


class DirectionalLampDescription(LampDescription):
    """Parallel light from far away, like the sun's, on a surface that faces it."""

    STRENGTHS = ("irradiance_w_per_m2", "illuminance_klx")

    type: Literal["directional"]
    """Told by this word."""
    direction: Vector
    """In which the light goes."""
    irradiance_w_per_m2: Positive | None = None
    """On a surface that faces it, within the band."""
    illuminance_klx: Positive | None = None
    """On a surface that faces it, taken for daylight's."""


class EnvironmentLampDescription(LampDescription):
    """Light from all around, from beyond everything, besides the sky.

    The same from everywhere, or `picture` times that: a PNG or NPY file (h, w) of the whole sphere,
    rows from the zenith down, columns from x by y (counter-clockwise seen from above), turned by
    `rotate_deg` as objects are. Of an OpenEXR or Radiance file (.exr, .hdr) it is the red, and its
    columns go clockwise from x, as such pictures are seen from within.
    """

    STRENGTHS = ("radiance_w_per_m2_sr", "luminance_kcd_per_m2")

    type: Literal["environment"]
    """Told by this word."""
    radiance_w_per_m2_sr: Positive | None = None
    """From everywhere, within the band."""
    luminance_kcd_per_m2: Positive | None = None
    """From everywhere, taken for daylight's."""
    picture: Name | None = None
    """PNG, NPY, OpenEXR or Radiance (.hdr) file (h, w) of the whole sphere, which multiplies it."""
    rotate_deg: Vector = (0.0, 0.0, 0.0)
    """Turns the picture, as objects are turned."""


AnyLamp = Annotated[
    AreaLampDescription
    | PointLampDescription
    | SpotLampDescription
    | DirectionalLampDescription
    | EnvironmentLampDescription,
    Field(discriminator="type"),
]
