"""What a scene file may say: the YAML fields, their units and limits."""

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
    """Where the instrument is and what it looks at, in world coordinates (z up), and its motion.

    From there it is moved by `offset_m`, [forward, left, up] of the drone, and turned about itself
    by `turn_deg`, [roll, pitch, yaw] about these axes in this order, right-handed: a pitch above
    zero looks down, a yaw to the left. Angular velocities are about the world's axes, right-handed,
    through the drone.
    """

    position_m: Vector
    """Where the projector's pinhole is, in world coordinates."""
    look_at_m: Vector
    """A point in the middle of the field; another one than the position."""
    up: Vector = (0.0, 0.0, 1.0)
    """Direction that is up in the picture; not along the line of sight."""
    offset_m: Vector = (0.0, 0.0, 0.0)
    """Moved by so much from there: [forward, left, up] of the drone."""
    turn_deg: Vector = (0.0, 0.0, 0.0)
    """Then turned about itself: [roll, pitch, yaw]."""
    velocity_m_s: Vector = (0.0, 0.0, 0.0)
    """How it flies while it records, along the world's axes."""
    angular_velocity_deg_s: Vector = (0.0, 0.0, 0.0)
    """How it turns meanwhile, about the world's axes through the drone."""


class DroneState(DroneDescription):
    """A moment of a flight: the drone as it is then, and all else `time_s` after the file's poses.

    It takes the drone's place after everything else is made, so that a family draws the same world
    for every moment.
    """

    time_s: NonNegative
    """So long after the poses that the file gives."""


class Pose(Section):
    """Rotate, then move.

    `rotate_deg` is [roll, pitch, yaw]: about the fixed axes x, then y, then z, right-handed.
    """

    rotate_deg: Vector = (0.0, 0.0, 0.0)
    """[roll, pitch, yaw] about the fixed axes x, then y, then z, right-handed."""
    translate_m: Vector = (0.0, 0.0, 0.0)
    """Moved by so much, after it is turned."""


class ObjectDescription(Pose):
    """What objects of every shape have in common.

    The shape is scaled, then posed. With `instances` there is one copy per entry, posed once more
    by it, and named name-1, name-2, …. Velocities are along and about the world's axes; every copy
    turns about the centre of its own bounding box.
    """

    name: Name
    """What messages and other sections call it; no two objects share one."""
    material: Name
    """A name of the table of materials, or of the scene's own `materials`."""
    scale: Positive = 1.0
    """Factor on all lengths, before the pose."""
    instances: Annotated[tuple[Pose, ...], Field(min_length=1)] | None = None
    """A copy for each pose; one copy without."""
    velocity_m_s: Vector = (0.0, 0.0, 0.0)
    """How it moves while the instrument records, along the world's axes."""
    angular_velocity_deg_s: Vector = (0.0, 0.0, 0.0)
    """How it turns meanwhile, about the centre of its bounds."""


class MeshObject(ObjectDescription):
    """A mesh file (PLY, OBJ, STL, OFF) in metres, z up; its path is relative to the scene file."""

    mesh: Name
    """PLY, OBJ, STL or OFF file, relative to the scene file."""


class BoxObject(ObjectDescription):
    """A box with edges `size_m` along x, y, z, centred on the origin."""

    shape: Literal["box"]
    """Told by this word."""
    size_m: tuple[Positive, Positive, Positive]
    """Edges along x, y and z."""


class RectangleObject(ObjectDescription):
    """A rectangle with edges `size_m` along x and y, centred on the origin, facing z."""

    shape: Literal["rectangle"]
    """Told by this word."""
    size_m: tuple[Positive, Positive]
    """Edges along x and y."""


class SphereObject(ObjectDescription):
    """A sphere centred on the origin."""

    shape: Literal["sphere"]
    """Told by this word."""
    radius_m: Positive
    """Radius."""


class CylinderObject(ObjectDescription):
    """A closed cylinder about z, centred on the origin."""

    shape: Literal["cylinder"]
    """Told by this word."""
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
    """An optional field whose bounds the model of the surface sees to, told in the JSON Schema."""
    return Field(None, json_schema_extra={"minimum": minimum, "maximum": 1})


class MaterialDescription(Section):
    """A material of this scene's own; `source` says where its values come from.

    Which of `roughness` to `returned` go with a `bsdf`, and their ranges, is up to the model. What
    changes with the wavelength may be given as a mapping from nm: `{850: 0.4, 1550: 0.3}`.
    """

    reflectance: FractionSpectrum | None = None
    """Share of the light that is reflected; left out where it follows from refraction."""
    source: Name
    """Where the values are from."""
    bsdf: str = Field("diffuse", json_schema_extra={"enum": list(BSDFS)})
    """Model of how the surface scatters."""
    roughness: Number | None = _up_to_1(MIN_RETRO_ROUGHNESS)
    """Width α of the distribution of slopes; at least 0.01 but for `retroreflector`."""
    distribution: Distribution | None = None
    """How the slopes of `rough-…` are spread: as GGX, or as Beckmann's, with fewer steep ones."""
    ior: NumberSpectrum | None = None
    """Refractive index relative to air; above 1 to 5, of a coat to 3."""
    eta: NumberSpectrum | None = None
    """Real part of a metal's refractive index; above 0."""
    k: NumberSpectrum | None = None
    """Imaginary part of a metal's refractive index; above 0."""
    metallic: Number | None = _up_to_1(0)
    """Share of metal in `principled`."""
    specular: Number | None = _up_to_1(MIN_SPECULAR)
    """Gloss of `principled`; 0.5 is a refractive index of 1.5."""
    returned: NumberSpectrum | None = _up_to_1(0)
    """Share that a `retroreflector` sends back to the source."""
    texture: Name | None = None
    """Picture that multiplies what is reflected, PNG or NPY; the mesh has coordinates for it."""
    opacity: Fraction | Name | None = None
    """Share of the surface that is there, or a picture of it."""

    def parameters(self) -> dict[str, Spectrum | str]:
        """Parameters of the model, as far as given."""
        names = (
            "roughness", "distribution", "ior", "eta", "k", "metallic", "specular", "returned"
        )  # fmt: skip
        return {name: getattr(self, name) for name in names if name in self.model_fields_set}


class VolumeDescription(Fog):
    """Fog or smoke that fills a part of space, in addition to what fills the air.

    `density` is a file of relative densities (nz, ny, nx) that fills the smallest box around that
    part, in its own axes, `structure` what to make them from.
    """

    name: Name
    """What messages call it; no two volumes share one."""
    density: Name | None = None
    """NPY file of relative densities (nz, ny, nx); not beside `structure`."""
    structure: Structure | None = None
    """Patches, layer or plume to make the density from; the same everywhere without."""

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
    """What a closed mesh encloses, scaled and then posed; light does not notice the mesh itself."""

    mesh: Name
    """Closed mesh, a file relative to the scene file."""
    scale: Positive = 1.0
    """Factor on all lengths, before the pose."""


class ObjectVolume(VolumeDescription):
    """What an object encloses, milk in a glass, and moves with it; its mesh has to be closed."""

    object: Name
    """Name of an object of the scene, whose mesh is closed."""


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
    """Illuminance of a surface that faces the sun; 100 is a clear noon."""
    sun_direction: Vector = (0.0, 0.0, -1.0)
    """From the sun into the scene, world axes."""
    sky_klx: NonNegative = 0.0
    """Illuminance of the ground under a uniform sky, without the sun."""


_SECTIONS: dict[str, Any] = {
    name: (
        Annotated[Weather, named(WEATHER, name)] | None,
        Field(None, description=f"{name.capitalize()} that fills all of the air."),
    )
    for name in WEATHER
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
    """A line for lists of scenes."""
    materials: dict[Name, MaterialDescription] = Field(default_factory=dict)
    """Materials of this scene's own, by name; they come before those of the table."""
    material_swaps: dict[Name, Name] = Field(default_factory=dict)
    """Materials in place of others, wherever those are used."""
    volumes: tuple[AnyVolume, ...] = ()
    """Fog or smoke in parts of space."""
    lamps: tuple[AnyLamp, ...] = ()
    """Steady light besides sun and sky."""
    moment: DroneState | None = None
    """A moment of a flight, instead of the file's own poses."""


class SceneDescription(Surroundings):
    """A whole scene file."""

    name: Name
    """What captures and reports call the scene."""
    drone: DroneDescription
    """Where the instrument is."""
    objects: Annotated[tuple[AnyObject, ...], Field(min_length=1)]
    """What light meets."""
    ambient: AmbientDescription = AmbientDescription()
    """Daylight."""


class DrawnDescription(Surroundings):
    """A scene file that names a family, from which `seed` draws all that `parameters` leave open.

    Its own sections take the place of those drawn, fields of `drone` and `ambient` one by one; its
    objects come in addition.
    """

    family: Name
    """Name of a family; `spisim scenes list` has them."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Another world for each."""
    name: Name | None = None
    """What captures and reports call the scene; the family's name and seed without."""
    parameters: dict[Name, Any] = Field(default_factory=dict)
    """Parameters of the family that are not to be drawn; `spisim scenes list FAMILY`."""
    drone: dict[Name, Any] = Field(default_factory=dict)
    """Fields of `drone` in place of those drawn, see below."""
    objects: tuple[AnyObject, ...] = ()
    """Objects in addition to those drawn."""
    ambient: dict[Name, Any] = Field(default_factory=dict)
    """Fields of `ambient` in place of those drawn, see below."""
