"""Another drone, hovering ahead: thin arms, thinner rotors, a load on a rope."""

from dataclasses import dataclass

import numpy as np
from trimesh.creation import icosphere, torus
from trimesh.transformations import rotation_matrix

from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import BACKDROPS, add_backdrop, outdoors
from spisim_worlds.parts.shapes import Mesh, block, lathe, loft, moved, rod, tube, union

#: Fraction of its disc that a turning rotor covers on average.
SOLIDITY = 0.12
BLURRED_ROTOR = {
    "reflectance": 0.5,
    "opacity": SOLIDITY,
    "source": "estimate for a polypropylene rotor, thinned by the share of its disc that it covers",
}


class DroneParameters(Parameters):
    """A multicopter with `arm_pairs` arms on either side, seen from `height_m`."""

    distance_m: float = drawn_log(1.8, 5.0, "to the middle of the other drone")
    diagonal_m: float = drawn_log(0.25, 0.75, "from motor to opposite motor")
    arm_pairs: int = drawn(2, 4, "half the number of arms")
    height_m: float = drawn(1.5, 4.0, "of both drones above the ground")
    above_m: float = drawn(-0.25, 0.25, "how much higher the other one flies")
    yaw_deg: float = drawn(-180.0, 180.0, "which way it faces; 0 is away from us")
    pitch_deg: float = drawn(-20.0, 20.0, "of its frame, as when it speeds up or brakes")
    roll_deg: float = drawn(-20.0, 20.0, "of its frame, as when it drifts sideways")
    rotors: str = one_of("blades", "blurred", text="standing still, or averaged over a turn")
    guards: str = one_of("none", "rings", text="hoops around the rotors")
    legs: str = one_of("skids", "stilts", text="what it lands on")
    load: str = one_of("none", "parcel", "tether", text="what hangs from it")
    rope_mm: float = drawn_log(3.0, 8.0, "diameter of the rope or tether")
    frame: str = one_of("rubber-black", "polypropylene", "aluminium-anodised", text="its material")
    backdrop: str = one_of(*BACKDROPS, text="what is behind")
    backdrop_m: float = drawn(1.5, 4.0, "from the other drone to the backdrop")


@dataclass(frozen=True)
class Airframe:
    """Dimensions of a multicopter in metres, and positions of its motors."""

    diagonal: float
    arms: int

    @property
    def motors(self) -> list[tuple[float, float]]:
        """Positions (x, y) of the motors; x is ahead, between two arms."""
        angles = 2 * np.pi * (np.arange(self.arms) + 0.5) / self.arms
        return [(self.diagonal / 2 * np.cos(a), self.diagonal / 2 * np.sin(a)) for a in angles]

    @property
    def rotor(self) -> float:
        """Radius of a rotor; neighbours do not touch."""
        return 0.9 * self.diagonal / 2 * float(np.sin(np.pi / self.arms))

    @property
    def hub(self) -> float:
        """Radius of the body."""
        return 0.16 * self.diagonal

    @property
    def deck(self) -> float:
        """Height of the rotors above the arms."""
        return 0.05 + 0.05 * self.diagonal


def build(parameters: DroneParameters, rng: np.random.Generator) -> SceneBuilder:
    """The other drone ahead, what hangs from it, and the backdrop."""
    eye = (0.0, 0.0, parameters.height_m)
    at = (parameters.distance_m, 0.0, parameters.height_m + parameters.above_m)
    aim = (at[0], rng.uniform(-0.05, 0.05) * at[0], at[2] - 0.03 * at[0])
    builder = SceneBuilder(position_m=eye, look_at_m=aim, **outdoors(rng))
    _add_drone(builder, parameters, at, rng)
    _add_load(builder, parameters, at)
    far = at[0] + parameters.backdrop_m
    axis_z = eye[2] + (aim[2] - eye[2]) * far / at[0]
    add_backdrop(builder, parameters.backdrop, far, axis_z, rng)
    return builder


def _add_drone(
    builder: SceneBuilder,
    parameters: DroneParameters,
    at: tuple[float, float, float],
    rng: np.random.Generator,
) -> None:
    size = Airframe(parameters.diagonal_m, 2 * parameters.arm_pairs)
    turn = (parameters.roll_deg, parameters.pitch_deg, parameters.yaw_deg)
    parts = {
        ("frame", parameters.frame): union([_frame(size), _LEGS[parameters.legs](size)]),
        ("motors", "aluminium-anodised"): _motors(size),
        ("battery", "polyethylene-film"): block(
            (1.5 * size.hub, 0.9 * size.hub, 0.5 * size.hub), (-0.1 * size.hub, 0, 0.65 * size.hub)
        ),
        ("gimbal camera", "paint-white"): _camera(size),
        ("camera lens", "rubber-black"): _lens(size),
        ("antennas", "rubber-black"): _antennas(size),
    }
    if parameters.rotors == "blades":
        parts["rotors", "polypropylene"] = _rotors(size, rng)
    else:
        builder.materials["turning rotor"] = BLURRED_ROTOR
        parts["rotors", "turning rotor"] = _discs(size)
    if parameters.guards == "rings":
        parts["rotor guards", "polypropylene"] = _guards(size)
    for (name, material), mesh in parts.items():
        builder.mesh(name, material, mesh, at, turn)


def _add_load(
    builder: SceneBuilder, parameters: DroneParameters, at: tuple[float, float, float]
) -> None:
    """A parcel on a rope, or a tether that runs to a winch on the ground."""
    x, y, z = at
    radius = parameters.rope_mm / 2000
    start = (x, y, z - 0.3 * Airframe(parameters.diagonal_m, 4).hub)
    if parameters.load == "parcel":
        edge = 0.35 * parameters.diagonal_m
        low = z - 0.14 * x - 0.1 * parameters.diagonal_m
        builder.mesh("rope", "polyester-fabric", rod(start, (x, y, low), radius, 8))
        builder.box("parcel", "cardboard", (edge, 0.8 * edge, 0.6 * edge), (x, y, low), (0, 0, 20))
    elif parameters.load == "tether":
        # Approximates a tether under its own weight: steep above, slack below.
        along = np.linspace(0, 1, 16)
        drift = 0.6 * along**3
        path = np.stack([x + drift, y + 0.7 * drift, start[2] * (1 - along) + 0.02], axis=1)
        builder.mesh("tether", "polyester-fabric", tube(path, radius))


def _frame(size: Airframe) -> Mesh:
    """Body and arms."""
    hub = size.hub
    body = lathe(
        [
            (0, -0.4 * hub),
            (0.8 * hub, -0.4 * hub),
            (hub, 0),
            (0.75 * hub, 0.4 * hub),
            (0, 0.45 * hub),
        ],
        20,
    )
    body.apply_scale((1.35, 0.95, 1))
    thick = 0.012 + 0.012 * size.diagonal
    arms = [rod((0, 0, 0), (x, y, 0.01), thick, 8) for x, y in size.motors]
    mounts = [rod((x, y, -0.02), (x, y, 0.6 * size.deck), 1.3 * thick, 10) for x, y in size.motors]
    return union([body, *arms, *mounts])


def _motors(size: Airframe) -> Mesh:
    low, high = 0.55 * size.deck, size.deck
    return union(
        [rod((x, y, low), (x, y, high), 0.015 + 0.02 * size.diagonal, 12) for x, y in size.motors]
    )


def _rotors(size: Airframe, rng: np.random.Generator) -> Mesh:
    """Add two twisted 2 mm blades per motor, stopped at random."""
    rotors = []
    for x, y in size.motors:
        start = rng.uniform(0, np.pi)
        blades = [_blade(size.rotor, start + half) for half in (0, np.pi)]
        rotors.append(moved(union(blades), (x, y, size.deck + 0.005)))
    return union(rotors)


def _blade(length: float, angle: float) -> Mesh:
    """Tapered blade along x from the hub, its pitch falling from 25° to 8°, turned about z."""
    stations = np.linspace(0.02, 1, 7)
    chord = length * np.interp(stations, (0, 0.25, 1), (0.08, 0.2, 0.07))
    pitch = np.radians(np.interp(stations, (0, 1), (25, 8)))
    section = np.array([(-0.5, -1.0), (0.5, -1.0), (0.5, 1.0), (-0.5, 1.0)])
    y = np.outer(chord, section[:, 0])
    z = np.broadcast_to(0.001 * section[:, 1], y.shape)
    cosine, sine = np.cos(pitch)[:, None], np.sin(pitch)[:, None]
    x = np.broadcast_to(length * stations[:, None], y.shape)
    blade = loft(np.stack([x, y * cosine - z * sine, y * sine + z * cosine], axis=-1))
    return blade.apply_transform(rotation_matrix(angle, (0, 0, 1)))


def _discs(size: Airframe) -> Mesh:
    z = size.deck + 0.005
    return union([rod((x, y, z), (x, y, z + 0.002), size.rotor, 28) for x, y in size.motors])


def _guards(size: Airframe) -> Mesh:
    """A hoop around each rotor on three struts."""
    hoop, thick = 1.04 * size.rotor, 0.003 + 0.006 * size.diagonal
    guards = []
    for x, y in size.motors:
        guards.append(moved(torus(hoop, thick, 28, 6), (x, y, size.deck)))
        for angle in np.radians((90, 210, 330)) + np.arctan2(y, x):
            rim = (x + hoop * np.cos(angle), y + hoop * np.sin(angle), size.deck)
            guards.append(rod((x, y, 0.4 * size.deck), rim, 0.6 * thick, 6))
    return union(guards)


def _skids(size: Airframe) -> Mesh:
    """Two level runners, each on two struts."""
    hub, low, thick = size.hub, -1.8 * size.hub, 0.008 + 0.006 * size.diagonal
    runners = [
        rod((-1.4 * hub, y, low), (1.4 * hub, y, low), thick, 8) for y in (-1.1 * hub, 1.1 * hub)
    ]
    struts = [
        rod((x, 0.6 * y, -0.2 * hub), (x, y, low), 0.8 * thick, 8)
        for x in (-0.7 * hub, 0.7 * hub)
        for y in (-1.1 * hub, 1.1 * hub)
    ]
    return union(runners + struts)


def _stilts(size: Airframe) -> Mesh:
    """A leg under every motor."""
    thick, low = 0.007 + 0.006 * size.diagonal, -1.2 * size.hub
    return union(
        [rod((0.95 * x, 0.95 * y, 0), (1.02 * x, 1.02 * y, low), thick, 8) for x, y in size.motors]
    )


def _camera(size: Airframe) -> Mesh:
    hub = size.hub
    ball = moved(icosphere(2, 0.3 * hub), (1.15 * hub, 0, -0.65 * hub))
    yoke = rod((1.15 * hub, 0, -0.55 * hub), (0.8 * hub, 0, -0.1 * hub), 0.1 * hub, 8)
    return union([ball, yoke])


def _lens(size: Airframe) -> Mesh:
    hub = size.hub
    return rod((1.35 * hub, 0, -0.65 * hub), (1.55 * hub, 0, -0.65 * hub), 0.16 * hub, 12)


def _antennas(size: Airframe) -> Mesh:
    """Two whips of 4 mm."""
    hub = size.hub
    return union(
        [
            rod((-1.1 * hub, y, 0.2 * hub), (-1.5 * hub, 1.6 * y, 1.6 * hub), 0.002, 6)
            for y in (-0.3 * hub, 0.3 * hub)
        ]
    )


_LEGS = {"skids": _skids, "stilts": _stilts}

FAMILY = Family(
    "Another drone in the air, with thin rotors and a rope, before a wall, a hedge or containers",
    DroneParameters,
    build,
)
