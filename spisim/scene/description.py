"""What a scene file may say: the YAML fields, their units and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from reconstruction.errors import nearest
from spisim.atmosphere import PHASES, SNOW_G, Diffraction, PhaseName
from spisim.atmosphere.precipitation import FLAKE_KG_PER_M3, FLAKE_SPEED_M_S
from spisim.atmosphere.structure import Structure
from spisim.config import Fraction, Name, NonNegative, Number, Positive, Section, Vector


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

    Which of `roughness` to `specular` go with a `bsdf`, and their ranges, is up to the model. What
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
    texture: Name | None = None
    opacity: Fraction | Name | None = None

    def parameters(self) -> dict[str, Spectrum]:
        """Parameters of the model, as far as given."""
        names = ("roughness", "ior", "eta", "k", "metallic", "specular")
        return {name: getattr(self, name) for name in names if name in self.model_fields_set}


class PhaseDescription(Section):
    """A phase function: `g` of Henyey-Greenstein, a `table` file, or a `blend` of several.

    Beside a table, `g` is what its mean cosine should be, and `unit` whether its values are
    absolute.
    """

    g: Annotated[Number, Field(gt=-1, lt=1)] | None = None
    table: Name | None = None
    unit: Literal["relative", "1/sr"] = "relative"
    blend: Annotated[tuple[BlendPart, ...], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> PhaseDescription:
        given = self.model_fields_set - {"weight"}
        allowed = {"table", "g", "unit"} if "table" in given else {"g"}
        if given not in ({"blend"}, {"g"}) and not ("table" in given and given <= allowed):
            raise PydanticCustomError("phase", "needs one of g, table (with unit and g), or blend")
        return self


class BlendPart(PhaseDescription):
    """A phase function's share of a blend; the weights sum to 1."""

    weight: Positive


class DropletDescription(Section):
    """Sizes of droplets or particles: a modified gamma distribution or a log-normal one.

    n(r) ∝ r^alpha exp(-b r^gamma) with its peak at `mode_radius_um`; or half of the particles
    below `median_diameter_um` and 68 % within a factor `sigma_g`. They are of water unless `n` and
    `k` give another refractive index n - ik.
    """

    alpha: Number | None = None
    gamma: Number | None = None
    mode_radius_um: Number | None = None
    median_diameter_um: Number | None = None
    sigma_g: Number | None = None
    n: Number | None = None
    k: Number = 0.0

    @model_validator(mode="after")
    def _one_way(self) -> DropletDescription:
        ways = {"alpha", "gamma", "mode_radius_um"}, {"median_diameter_um", "sigma_g"}
        if self.model_fields_set - {"n", "k"} not in ways:
            message = "needs alpha, gamma and mode_radius_um, or median_diameter_um and sigma_g"
            raise PydanticCustomError("droplets", message)
        if "k" in self.model_fields_set and self.n is None:
            raise PydanticCustomError("droplets", "k needs n")
        return self


AnyPhase = Annotated[
    Annotated[PhaseName, Tag("by name")] | Annotated[PhaseDescription, Tag("by numbers")],
    Discriminator(lambda data: "by name" if isinstance(data, str) else "by numbers"),
]


class FogDescription(Section):
    """Fog by visibility or water, or a medium by its coefficients, at any wavelength the same.

    Its droplets are of a `kind` or have sizes of their own (`droplets`). The `phase` of fog by
    visibility or water is the name of a form, that of a medium by coefficients a phase function.
    """

    visibility_m: Positive | None = None
    liquid_water_g_per_m3: Positive | None = None
    kind: str = "moderate-radiation"
    droplets: DropletDescription | None = None
    definition: str = "koschmieder"
    extinction_per_m: NonNegative | None = None
    albedo: Fraction = 1.0
    g: Annotated[Number, Field(gt=-1, lt=1)] = 0.0
    phase: AnyPhase | None = None

    @model_validator(mode="after")
    def _one_way(self) -> FogDescription:
        given = self.model_fields_set
        amounts = [f for f in ("visibility_m", "liquid_water_g_per_m3") if f in given]
        if bool(amounts) == ("extinction_per_m" in given):
            raise PydanticCustomError(
                "fog", "needs either visibility_m or extinction_per_m, or liquid_water_g_per_m3"
            )
        for pair in ({"g", "phase"}, {"kind", "droplets"}):
            if pair <= given:
                one, other = sorted(pair, key=list(type(self).model_fields).index)
                raise PydanticCustomError(
                    "fog", "needs {one} or {other}, not both", {"one": one, "other": other}
                )
        way = amounts[0] if amounts else "extinction_per_m"
        stray = sorted(given & ({"albedo", "g"} if amounts else {"kind", "droplets", "definition"}))
        if "phase" in given and isinstance(self.phase, str) != bool(amounts):
            stray.append("phase")
        if stray:
            hint = f": it is one of {', '.join(PHASES)}" if amounts and stray == ["phase"] else ""
            raise PydanticCustomError(
                "fog",
                "{field} does not go with {way}{hint}",
                {"field": stray[0], "way": way, "hint": hint},
            )
        return self


class SmokeDescription(FogDescription):
    """Smoke, by the same fields as fog."""

    kind: str = "glycol"


class FallingDescription(Section):
    """What rain and snow have in common.

    As a `medium` they are smooth; as `drops` each drop or flake crosses the beams by itself, and
    drifts with the wind. Fields `of_medium` do not go with drops, nor those `of_drops` with it.
    """

    of_medium: ClassVar[frozenset[str]]
    of_drops: ClassVar[frozenset[str]] = frozenset({"wind_m_s"})
    rate_mm_per_h: Positive
    model: Literal["medium", "drops"] = "medium"
    wind_m_s: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _fields_of_its_model(self) -> FallingDescription:
        others = self.of_medium if self.model == "drops" else self.of_drops
        if stray := sorted(self.model_fields_set & others):
            raise PydanticCustomError(
                "falling",
                "{field} does not go with model {model}",
                {"field": stray[0], "model": self.model},
            )
        return self


class RainDescription(FallingDescription):
    """Rain of a rate; `diffraction` says whether light bent by a milliradian counts as lost."""

    of_medium = frozenset({"diffraction"})
    kind: str = "marshall-palmer"
    diffraction: Diffraction = "remove"


class SnowDescription(FallingDescription):
    """Snow of a rate (as water), "wet" or "dry"; its scattering and its flakes are assumed."""

    of_medium = frozenset({"kind"})
    of_drops = FallingDescription.of_drops | {"flake_density_kg_m3", "fall_speed_m_s"}
    kind: str = "wet"
    albedo: Fraction | None = None  # by the absorption of ice
    g: Annotated[Number, Field(gt=-1, lt=1)] = SNOW_G
    flake_density_kg_m3: Positive = FLAKE_KG_PER_M3
    fall_speed_m_s: Positive = FLAKE_SPEED_M_S


class VolumeDescription(Pose, FogDescription):
    """A box of fog or smoke with edges `size_m`, centred on the origin before its pose.

    `density` is a file of relative densities (nz, ny, nx) that fills the box, `structure` what to
    make them from.
    """

    name: Name
    size_m: tuple[Positive, Positive, Positive]
    density: Name | None = None
    structure: Structure | None = None

    @model_validator(mode="after")
    def _one_density(self) -> VolumeDescription:
        if self.density is not None and self.structure is not None:
            raise PydanticCustomError("volume", "needs density or structure, not both")
        return self


class AmbientDescription(Section):
    """Daylight: `sun_klx` on a surface that faces the sun, `sky_klx` on the ground."""

    sun_klx: NonNegative = 0.0
    sun_direction: Vector = (0.0, 0.0, -1.0)  # from the sun into the scene
    sky_klx: NonNegative = 0.0


class Surroundings(Section):
    """Sections that every scene file may have.

    `material_swaps` puts materials in place of others, wherever those are used, if they are.
    """

    description: str = ""
    materials: dict[Name, MaterialDescription] = Field(default_factory=dict)
    material_swaps: dict[Name, Name] = Field(default_factory=dict)
    fog: FogDescription | None = None
    smoke: SmokeDescription | None = None
    rain: RainDescription | None = None
    snow: SnowDescription | None = None
    volumes: tuple[VolumeDescription, ...] = ()
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
