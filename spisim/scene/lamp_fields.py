"""What a scene file may say of lamps: steady light besides sun and sky, never modulated.

How strong a lamp is stands in one field, in watts within the instrument's band, in front of its
filter, or in lumens: these count as daylight's, with its watts in the band for every lumen.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from spisim.config import Name, Number, Positive, Section, Vector


class LampDescription(Section):
    """What lamps of every type have in common: exactly one of the fields `STRENGTHS`."""

    STRENGTHS: ClassVar[tuple[str, ...]]

    name: Name

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
    object: Name
    radiance_w_per_m2_sr: Positive | None = None
    power_w: Positive | None = None
    luminous_flux_lm: Positive | None = None


class PointLampDescription(LampDescription):
    """A lamp without a size, which shines in all directions alike."""

    STRENGTHS = ("intensity_w_per_sr", "power_w", "luminous_flux_lm")

    type: Literal["point"]
    position_m: Vector
    intensity_w_per_sr: Positive | None = None
    power_w: Positive | None = None
    luminous_flux_lm: Positive | None = None


class SpotLampDescription(LampDescription):
    """A lamp without a size, which shines into a cone about its direction.

    As bright as on its axis up to `beam_deg` from it, three quarters of the cutoff unless given,
    from there on falling in proportion to the angle, to nothing at `cutoff_deg`.
    """

    STRENGTHS = ("intensity_w_per_sr", "power_w", "luminous_flux_lm")

    type: Literal["spot"]
    position_m: Vector
    direction: Vector
    cutoff_deg: Annotated[Number, Field(gt=0, le=90)] = 20.0
    beam_deg: Annotated[Number, Field(ge=0, le=90)] | None = None
    intensity_w_per_sr: Positive | None = None  # on the axis
    power_w: Positive | None = None
    luminous_flux_lm: Positive | None = None

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
    direction: Vector  # in which the light goes
    irradiance_w_per_m2: Positive | None = None
    illuminance_klx: Positive | None = None


class EnvironmentLampDescription(LampDescription):
    """Light from all around, from beyond everything, besides the sky.

    The same from everywhere, or `picture` times that: a PNG or NPY file (h, w) of the whole sphere,
    rows from the zenith down, columns from x by y (counter-clockwise seen from above), turned by
    `rotate_deg` as objects are.
    """

    STRENGTHS = ("radiance_w_per_m2_sr", "luminance_kcd_per_m2")

    type: Literal["environment"]
    radiance_w_per_m2_sr: Positive | None = None
    luminance_kcd_per_m2: Positive | None = None
    picture: Name | None = None
    rotate_deg: Vector = (0.0, 0.0, 0.0)


AnyLamp = Annotated[
    AreaLampDescription
    | PointLampDescription
    | SpotLampDescription
    | DirectionalLampDescription
    | EnvironmentLampDescription,
    Field(discriminator="type"),
]
