"""Lamps in scene files: constant, unmodulated light besides sun and sky.

One field gives a lamp's strength: watts within the instrument's band, in front of its filter, or
photometric units, converted with the in-band watts per lumen of daylight.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from spisim.base.config import Name, Number, Positive, Section, Vector


class LampDescription(Section):
    """Fields of lamps of every type; exactly one of `STRENGTHS` is given."""

    STRENGTHS: ClassVar[tuple[str, ...]]

    name: Name
    """Name in messages; unique among lamps."""

    @model_validator(mode="after")
    def _one_strength(self) -> LampDescription:
        if len(self.model_fields_set & set(self.STRENGTHS)) != 1:
            one_of = ", ".join(self.STRENGTHS)
            raise PydanticCustomError("lamp", "needs one of {fields}", {"fields": one_of})
        return self

    @property
    def strength(self) -> tuple[str, float]:
        """Name and value of the field given."""
        (field,) = self.model_fields_set & set(self.STRENGTHS)
        return field, getattr(self, field)


class AreaLampDescription(LampDescription):
    """An object whose surface also emits, Lambertian, on the side that its triangles face."""

    STRENGTHS = ("radiance_w_per_m2_sr", "power_w", "luminous_flux_lm")

    type: Literal["area"]
    """Type discriminator."""
    object: Name
    """Name of the emitting object."""
    radiance_w_per_m2_sr: Positive | None = None
    """In-band radiance of the surface."""
    power_w: Positive | None = None
    """In-band power of the whole surface."""
    luminous_flux_lm: Positive | None = None
    """Luminous flux of the whole surface, with daylight's spectrum."""


class PointLampDescription(LampDescription):
    """An isotropic point source."""

    STRENGTHS = ("intensity_w_per_sr", "power_w", "luminous_flux_lm")

    type: Literal["point"]
    """Type discriminator."""
    position_m: Vector
    """Position, world coordinates."""
    intensity_w_per_sr: Positive | None = None
    """In-band radiant intensity."""
    power_w: Positive | None = None
    """In-band power in all directions."""
    luminous_flux_lm: Positive | None = None
    """Luminous flux, with daylight's spectrum."""


class SpotLampDescription(LampDescription):
    """A point source that emits into a cone.

    Its intensity is constant up to `beam_deg` from the axis, then falls linearly with the angle to
    0 at `cutoff_deg`.
    """

    STRENGTHS = ("intensity_w_per_sr", "power_w", "luminous_flux_lm")

    type: Literal["spot"]
    """Type discriminator."""
    position_m: Vector
    """Position, world coordinates."""
    direction: Vector
    """Axis of the cone, in the direction of the light."""
    cutoff_deg: Annotated[Number, Field(gt=0, le=90)] = 20.0
    """Angle from the axis at which the light ends."""
    beam_deg: Annotated[Number, Field(ge=0, le=90)] | None = None
    """Angle from the axis at which it begins to fall; by default ¾ of the cutoff."""
    intensity_w_per_sr: Positive | None = None
    """In-band radiant intensity on the axis."""
    power_w: Positive | None = None
    """In-band power of the whole cone."""
    luminous_flux_lm: Positive | None = None
    """Luminous flux of the whole cone, with daylight's spectrum."""

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
    """Parallel light from infinity, like the sun's."""

    STRENGTHS = ("irradiance_w_per_m2", "illuminance_klx")

    type: Literal["directional"]
    """Type discriminator."""
    direction: Vector
    """Direction of the light."""
    irradiance_w_per_m2: Positive | None = None
    """In-band irradiance of a surface that faces it."""
    illuminance_klx: Positive | None = None
    """Illuminance of a surface that faces it, with daylight's spectrum."""


class EnvironmentLampDescription(LampDescription):
    """Light from all around, from infinity, besides the sky.

    It is uniform, or multiplied by a `picture` (h, w) of the whole sphere: PNG or NPY, rows from
    the zenith down, columns from x via y (counter-clockwise seen from above), rotated by
    `rotate_deg` as objects are. Of OpenEXR and Radiance files (.exr, .hdr), which show the sphere
    from inside, red is read and columns run clockwise from x.
    """

    STRENGTHS = ("radiance_w_per_m2_sr", "luminance_kcd_per_m2")

    type: Literal["environment"]
    """Type discriminator."""
    radiance_w_per_m2_sr: Positive | None = None
    """In-band radiance in every direction."""
    luminance_kcd_per_m2: Positive | None = None
    """Luminance in every direction, with daylight's spectrum."""
    picture: Name | None = None
    """PNG, NPY, OpenEXR or Radiance (.hdr) file (h, w) of the whole sphere, a factor."""
    rotate_deg: Vector = (0.0, 0.0, 0.0)
    """Rotation of the picture, as of objects."""


AnyLamp = Annotated[
    AreaLampDescription
    | PointLampDescription
    | SpotLampDescription
    | DirectionalLampDescription
    | EnvironmentLampDescription,
    Field(discriminator="type"),
]
