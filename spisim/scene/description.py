"""What a scene file may say: the YAML fields, their units and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag, create_model, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.errors import nearest
from spisim.atmosphere.sections import WEATHER
from spisim.atmosphere.sections.fog import Fog
from spisim.atmosphere.structure import Structure
from spisim.atmosphere.weather import Weather
from spisim.config import Fraction, Name, NonNegative, Number, Positive, Section, Vector, named
from spisim.scene.lamp_fields import AnyLamp


class DroneDescription(Section):
    """Where the instrument is and what it looks at, in world coordinates (z up), and its motion.

    From there it is moved by `offset_m`, [forward, left, up] of the drone, and turned about itself
    by `turn_deg`, [roll, pitch, yaw] about these axes in this order, right-handed: a pitch above
    zero looks down, a yaw to the left. Angular velocities are about the world's axes, right-handed,
    through the drone.
    """

    position_m: Vector
    look_at_m: Vector
    up: Vector = (0.0, 0.0, 1.0)
    offset_m: Vector = (0.0, 0.0, 0.0)
    turn_deg: Vector = (0.0, 0.0, 0.0)
    velocity_m_s: Vector = (0.0, 0.0, 0.0)
    angular_velocity_deg_s: Vector = (0.0, 0.0, 0.0)


class Moment(DroneDescription):
    """A moment of a flight: the drone as it is then, and all else `time_s` after the file's poses.

    It takes the drone's place after everything else is made, so that a family draws the same world
    for every moment.
    """

    time_s: NonNegative


class Pose(Section):
    """Rotate, then move.

    `rotate_deg` is [roll, pitch, yaw]: about the fixed axes x, then y, then z, right-handed.
    """

    rotate_deg: Vector = (0.0, 0.0, 0.0)
    translate_m: Vector = (0.0, 0.0, 0.0)


class ObjectDescription(Pose):
    """What objects of every shape have in common.

    The shape is scaled, then posed. With `instances` there is one copy per entry, posed once more
    by it, and named name-1, name-2, …. Velocities are along and about the world's axes; every copy
    turns about the centre of its own bounding box.
    """

    name: Name
    material: Name
    scale: Positive = 1.0
    instances: Annotated[tuple[Pose, ...], Field(min_length=1)] | None = None
    velocity_m_s: Vector = (0.0, 0.0, 0.0)
    angular_velocity_deg_s: Vector = (0.0, 0.0, 0.0)


class MeshObject(ObjectDescription):
    """A mesh file (PLY, OBJ, STL, OFF) in metres, z up; its path is relative to the scene file."""

    mesh: Name


class BoxObject(ObjectDescription):
    """A box with edges `size_m` along x, y, z, centred on the origin."""

    shape: Literal["box"]
    size_m: tuple[Positive, Positive, Positive]


class RectangleObject(ObjectDescription):
    """A rectangle with edges `size_m` along x and y, centred on the origin, facing z."""

    shape: Literal["rectangle"]
    size_m: tuple[Positive, Positive]


class SphereObject(ObjectDescription):
    """A sphere centred on the origin."""

    shape: Literal["sphere"]
    radius_m: Positive


class CylinderObject(ObjectDescription):
    """A closed cylinder about z, centred on the origin."""

    shape: Literal["cylinder"]
    radius_m: Positive
    height_m: Positive


SHAPES = ("box", "rectangle", "sphere", "cylinder")


def _with_known_shape(data: Any) -> Any:
    if not isinstance(data, Mapping):
        raise PydanticCustomError("object", "should be a mapping of fields")
    if "mesh" not in data and data.get("shape") not in SHAPES:
        wrong = f"unknown shape {data['shape']!r}" if "shape" in data else "has no mesh or shape"
        hint = nearest(str(data.get("shape", "")), SHAPES)
        raise PydanticCustomError("object", "{message}", {"message": f"{wrong}: {hint}"})
    return data


def _tag(data: Mapping[str, Any]) -> str:
    return "file" if "mesh" in data else data["shape"]


AnyObject = Annotated[
    Annotated[MeshObject, Tag("file")]
    | Annotated[BoxObject, Tag("box")]
    | Annotated[RectangleObject, Tag("rectangle")]
    | Annotated[SphereObject, Tag("sphere")]
    | Annotated[CylinderObject, Tag("cylinder")],
    Discriminator(_tag),
    BeforeValidator(_with_known_shape),
]


#: A value at every wavelength, or by wavelength in nm.
Spectrum: TypeAlias = float | Mapping[float, float]

_BY_WAVELENGTH = Discriminator(
    lambda data: "by wavelength" if isinstance(data, Mapping) else "at every wavelength"
)
NumberSpectrum = Annotated[
    Annotated[Number, Tag("at every wavelength")]
    | Annotated[dict[Positive, Number], Field(min_length=1), Tag("by wavelength")],
    _BY_WAVELENGTH,
]
FractionSpectrum = Annotated[
    Annotated[Fraction, Tag("at every wavelength")]
    | Annotated[dict[Positive, Fraction], Field(min_length=1), Tag("by wavelength")],
    _BY_WAVELENGTH,
]


class MaterialDescription(Section):
    """A material of this scene's own; `source` says where its values come from.

    Which of `roughness` to `returned` go with a `bsdf`, and their ranges, is up to the model. What
    changes with the wavelength may be given as a mapping from nm: `{850: 0.4, 1550: 0.3}`.
    """

    reflectance: FractionSpectrum | None = None
    source: Name
    bsdf: str = "diffuse"
    roughness: Number | None = None
    ior: NumberSpectrum | None = None
    eta: NumberSpectrum | None = None
    k: NumberSpectrum | None = None
    metallic: Number | None = None
    specular: Number | None = None
    returned: NumberSpectrum | None = None
    texture: Name | None = None
    opacity: Fraction | Name | None = None

    def parameters(self) -> dict[str, Spectrum]:
        """Parameters of the model, as far as given."""
        names = ("roughness", "ior", "eta", "k", "metallic", "specular", "returned")
        return {name: getattr(self, name) for name in names if name in self.model_fields_set}


class VolumeDescription(Fog):
    """Fog or smoke that fills a part of space, in addition to what fills the air.

    `density` is a file of relative densities (nz, ny, nx) that fills the smallest box around that
    part, in its own axes, `structure` what to make them from.
    """

    name: Name
    density: Name | None = None
    structure: Structure | None = None

    @model_validator(mode="after")
    def _one_density(self) -> VolumeDescription:
        if self.density is not None and self.structure is not None:
            raise PydanticCustomError("volume", "needs density or structure, not both")
        return self


class BoxVolume(Pose, VolumeDescription):
    """A box with edges `size_m`, centred on the origin before its pose."""

    size_m: tuple[Positive, Positive, Positive]


class BallVolume(Pose, VolumeDescription):
    """A ball centred on the origin before its pose."""

    radius_m: Positive


class MeshVolume(Pose, VolumeDescription):
    """What a closed mesh encloses, scaled and then posed; light does not notice the mesh itself."""

    mesh: Name
    scale: Positive = 1.0


class ObjectVolume(VolumeDescription):
    """What an object encloses, milk in a glass, and moves with it; its mesh has to be closed."""

    object: Name


#: How a volume is told apart, by the field that gives its shape.
VOLUME_TAGS = {"mesh": "in a mesh", "object": "in an object", "radius_m": "a ball"}


def _volume_tag(data: Any) -> str:
    fields = data if isinstance(data, Mapping) else {}
    return next((tag for field, tag in VOLUME_TAGS.items() if field in fields), "a box")


AnyVolume = Annotated[
    Annotated[BoxVolume, Tag("a box")]
    | Annotated[BallVolume, Tag("a ball")]
    | Annotated[MeshVolume, Tag("in a mesh")]
    | Annotated[ObjectVolume, Tag("in an object")],
    Discriminator(_volume_tag),
]


class AmbientDescription(Section):
    """Daylight: `sun_klx` on a surface that faces the sun, `sky_klx` on the ground."""

    sun_klx: NonNegative = 0.0
    sun_direction: Vector = (0.0, 0.0, -1.0)  # from the sun into the scene
    sky_klx: NonNegative = 0.0


_SECTIONS: dict[str, Any] = {
    name: (Annotated[Weather, named(WEATHER, name)] | None, None) for name in WEATHER
}
#: What fills all of the air: a section for each kind of weather.
Air: Any = create_model(
    "Air",
    __base__=Section,
    **_SECTIONS,
)


class Surroundings(Air):
    """Sections that every scene file may have.

    `material_swaps` puts materials in place of others, wherever those are used, if they are.
    """

    description: str = ""
    materials: dict[Name, MaterialDescription] = Field(default_factory=dict)
    material_swaps: dict[Name, Name] = Field(default_factory=dict)
    volumes: tuple[AnyVolume, ...] = ()
    lamps: tuple[AnyLamp, ...] = ()
    moment: Moment | None = None


class SceneDescription(Surroundings):
    """A whole scene file."""

    name: Name
    drone: DroneDescription
    objects: Annotated[tuple[AnyObject, ...], Field(min_length=1)]
    ambient: AmbientDescription = AmbientDescription()


class DrawnDescription(Surroundings):
    """A scene file that names a family, from which `seed` draws all that `parameters` leave open.

    Its own sections take the place of those drawn, fields of `drone` and `ambient` one by one; its
    objects come in addition.
    """

    family: Name
    seed: Annotated[int, Field(ge=0)] = 0
    name: Name | None = None
    parameters: dict[Name, Any] = Field(default_factory=dict)
    drone: dict[Name, Any] = Field(default_factory=dict)
    objects: tuple[AnyObject, ...] = ()
    ambient: dict[Name, Any] = Field(default_factory=dict)
