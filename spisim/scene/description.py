"""Fields of scene files, with their units and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag, create_model, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.base.errors import nearest
from spisim.atmosphere.sections import WEATHER
from spisim.atmosphere.sections.fog import Fog
from spisim.atmosphere.structure import Structure
from spisim.atmosphere.weather import Weather
from spisim.base.config import Fraction, Name, NonNegative, Number, Positive, Section, Vector, named
from spisim.scene.bsdf import BSDFS, MIN_RETRO_ROUGHNESS, MIN_SPECULAR, Distribution
from spisim.scene.lamp_fields import AnyLamp


class DroneDescription(Section):
    """Pose and motion of the instrument, in world coordinates (z up).

    `offset_m` and then `turn_deg` correct the pose in the drone's axes (forward, left, up), in
    roll, pitch, yaw order, right-handed: positive pitch looks down, positive yaw to the left.
    """

    position_m: Vector
    """Position of the projector's pinhole, world coordinates."""
    look_at_m: Vector
    """A point on the optical axis; not the position itself."""
    up: Vector = (0.0, 0.0, 1.0)
    """Direction that is up in the image; not along the line of sight."""
    offset_m: Vector = (0.0, 0.0, 0.0)
    """Displacement from the position: [forward, left, up] of the drone."""
    turn_deg: Vector = (0.0, 0.0, 0.0)
    """Rotation after the displacement: [roll, pitch, yaw]."""
    velocity_m_s: Vector = (0.0, 0.0, 0.0)
    """Velocity during the recording, along the world's axes."""
    angular_velocity_deg_s: Vector = (0.0, 0.0, 0.0)
    """Angular velocity during the recording, about the world's axes through the drone."""


class DroneState(DroneDescription):
    """A timestamped pose of a flight, which replaces the drone once everything else is made."""

    time_s: NonNegative
    """Time since the poses in the file."""


class Pose(Section):
    """Rotation, then translation."""

    rotate_deg: Vector = (0.0, 0.0, 0.0)
    """[roll, pitch, yaw] about the fixed axes x, then y, then z, right-handed."""
    translate_m: Vector = (0.0, 0.0, 0.0)
    """Translation after the rotation."""


class ObjectDescription(Pose):
    """Fields of objects of every shape.

    The shape is scaled, then posed. `instances` makes one copy per pose, applied last, named
    name-1, name-2, …; each copy turns about the centre of its own bounding box.
    """

    name: Name
    """Name in messages and other sections; unique among objects."""
    material: Name
    """Name of a material in the table or in the scene's own `materials`."""
    scale: Positive = 1.0
    """Factor on all lengths, before the pose."""
    instances: Annotated[tuple[Pose, ...], Field(min_length=1)] | None = None
    """Poses of copies; a single object by default."""
    velocity_m_s: Vector = (0.0, 0.0, 0.0)
    """Velocity during the recording, along the world's axes."""
    angular_velocity_deg_s: Vector = (0.0, 0.0, 0.0)
    """Angular velocity during the recording, about the centre of its bounds."""


class MeshObject(ObjectDescription):
    """A mesh file (PLY, OBJ, STL, OFF) in metres, z up; its path is relative to the scene file."""

    mesh: Name
    """PLY, OBJ, STL or OFF file, relative to the scene file."""


class BoxObject(ObjectDescription):
    """A box with edges `size_m` along x, y, z, centred on the origin."""

    shape: Literal["box"]
    """Shape discriminator."""
    size_m: tuple[Positive, Positive, Positive]
    """Edges along x, y and z."""


class RectangleObject(ObjectDescription):
    """A rectangle with edges `size_m` along x and y, centred on the origin, facing z."""

    shape: Literal["rectangle"]
    """Shape discriminator."""
    size_m: tuple[Positive, Positive]
    """Edges along x and y."""


class SphereObject(ObjectDescription):
    """A sphere centred on the origin."""

    shape: Literal["sphere"]
    """Shape discriminator."""
    radius_m: Positive
    """Radius."""


class CylinderObject(ObjectDescription):
    """A closed cylinder about z, centred on the origin."""

    shape: Literal["cylinder"]
    """Shape discriminator."""
    radius_m: Positive
    """Radius."""
    height_m: Positive
    """Length along z."""


SHAPES = ("box", "rectangle", "sphere", "cylinder")


def _with_shape(data: Any) -> Any:
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
    BeforeValidator(_with_shape),
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


def _up_to_1(minimum: float) -> Any:
    """An optional field whose bounds, stated in the JSON Schema, the surface model checks."""
    return Field(None, json_schema_extra={"minimum": minimum, "maximum": 1})


class MaterialDescription(Section):
    """A material of this scene's own; its `bsdf` determines which parameters it takes.

    Spectral values may be a mapping from nm: `{850: 0.4, 1550: 0.3}`.
    """

    reflectance: FractionSpectrum | None = None
    """Reflected fraction of the light; omit it where it follows from refraction."""
    source: Name
    """Origin of the values."""
    bsdf: str = Field("diffuse", json_schema_extra={"enum": list(BSDFS)})
    """Scattering model of the surface."""
    roughness: Number | None = _up_to_1(MIN_RETRO_ROUGHNESS)
    """Width α of the slope distribution; at least 0.01 but for `retroreflector`."""
    distribution: Distribution | None = None
    """Slope distribution of the `rough-…` models: ggx, or beckmann with fewer steep slopes."""
    ior: NumberSpectrum | None = None
    """Refractive index relative to air; above 1, at most 5, of a coat at most 3."""
    eta: NumberSpectrum | None = None
    """Real part of a metal's refractive index; above 0."""
    k: NumberSpectrum | None = None
    """Imaginary part of a metal's refractive index; above 0."""
    metallic: Number | None = _up_to_1(0)
    """Metal fraction of `principled`."""
    specular: Number | None = _up_to_1(MIN_SPECULAR)
    """Gloss of `principled`; 0.5 is a refractive index of 1.5."""
    returned: NumberSpectrum | None = _up_to_1(0)
    """Fraction that a `retroreflector` returns to the source."""
    texture: Name | None = None
    """Picture (PNG or NPY) that multiplies the reflectance; needs texture coordinates."""
    opacity: Fraction | Name | None = None
    """Opaque fraction of the surface, or a picture of it."""

    def parameters(self) -> dict[str, Spectrum | str]:
        """Parameters of the model that are given."""
        names = (
            "roughness", "distribution", "ior", "eta", "k", "metallic", "specular", "returned"
        )  # fmt: skip
        return {name: getattr(self, name) for name in names if name in self.model_fields_set}


class VolumeDescription(Fog):
    """Fog or smoke in a part of space, in addition to that in all the air."""

    name: Name
    """Name in messages; unique among volumes."""
    density: Name | None = None
    """NPY file of relative densities (nz, ny, nx); excludes `structure`."""
    structure: Structure | None = None
    """Patches, layer or plume that make the density; uniform by default."""

    @model_validator(mode="after")
    def _one_density(self) -> VolumeDescription:
        if self.density is not None and self.structure is not None:
            raise PydanticCustomError("volume", "needs density or structure, not both")
        return self


class BoxVolume(Pose, VolumeDescription):
    """A box with edges `size_m`, centred on the origin before its pose."""

    size_m: tuple[Positive, Positive, Positive]
    """Edges along x, y and z."""


class BallVolume(Pose, VolumeDescription):
    """A ball centred on the origin before its pose."""

    radius_m: Positive
    """Radius."""


class MeshVolume(Pose, VolumeDescription):
    """The interior of a closed mesh, scaled and then posed; the mesh itself is invisible."""

    mesh: Name
    """File of a closed mesh, relative to the scene file."""
    scale: Positive = 1.0
    """Factor on all lengths, before the pose."""


class ObjectVolume(VolumeDescription):
    """The interior of an object with a closed mesh (milk in a glass), which moves with it."""

    object: Name
    """Name of an object of the scene with a closed mesh."""


#: Union tag of a volume, by the field that gives its shape.
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
    """Daylight."""

    sun_klx: NonNegative = 0.0
    """Illuminance of a surface that faces the sun; 100 at a clear noon."""
    sun_direction: Vector = (0.0, 0.0, -1.0)
    """Direction from the sun into the scene, world axes."""
    sky_klx: NonNegative = 0.0
    """Illuminance of the ground by a uniform sky, without the sun."""


_SECTIONS: dict[str, Any] = {
    name: (
        Annotated[Weather, named(WEATHER, name)] | None,
        Field(None, description=f"{name.capitalize()} in all the air."),
    )
    for name in WEATHER
}
#: Media in all the air: a section for each kind of weather.
Air: Any = create_model("Air", __base__=Section, **_SECTIONS)


class Surroundings(Air):
    """Sections that every scene file may have."""

    description: str = ""
    """One line for lists of scenes."""
    materials: dict[Name, MaterialDescription] = Field(default_factory=dict)
    """The scene's own materials by name; they take precedence over the table."""
    material_swaps: dict[Name, Name] = Field(default_factory=dict)
    """Replacements of materials, wherever those are used."""
    volumes: tuple[AnyVolume, ...] = ()
    """Fog or smoke in parts of space."""
    lamps: tuple[AnyLamp, ...] = ()
    """Constant light besides sun and sky."""
    moment: DroneState | None = None
    """Timestamped pose of a flight that replaces the file's own poses."""


class SceneDescription(Surroundings):
    """A complete scene file."""

    name: Name
    """Name of the scene in captures and reports."""
    drone: DroneDescription
    """Pose of the instrument."""
    objects: Annotated[tuple[AnyObject, ...], Field(min_length=1)]
    """Surfaces."""
    ambient: AmbientDescription = AmbientDescription()
    """Daylight."""


class DrawnDescription(Surroundings):
    """A scene file that names a family, from which `seed` draws what `parameters` leave open.

    Its own sections replace those drawn, `drone` and `ambient` field by field; its objects are
    added.
    """

    family: Name
    """Name of a family; `spisim scenes list` lists them."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the world."""
    name: Name | None = None
    """Name of the scene in captures and reports; by default family and seed."""
    parameters: dict[Name, Any] = Field(default_factory=dict)
    """Parameters of the family that are fixed; see `spisim scenes list FAMILY`."""
    drone: dict[Name, Any] = Field(default_factory=dict)
    """Fields of `drone` that replace those drawn, see below."""
    objects: tuple[AnyObject, ...] = ()
    """Objects in addition to those drawn."""
    ambient: dict[Name, Any] = Field(default_factory=dict)
    """Fields of `ambient` that replace those drawn, see below."""
