"""Derivatives of light by the pose of the drone or the position of an object.

Where geometry moves, so do its edges, and no path says what they uncover. Light is traced at both
ends of a small step instead, with the same random numbers: paths that meet no edge cancel, which
leaves some hundredth of the variance of independent passes. Errors are those of the mean of several
such pairs. Steps leave an error of their second order, and of how far an edge moves over a pixel.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light.solve import Transport, solve
from spisim.transport.engine.path_weights import Score

#: Half the step of positions, in metres, and of angles, in degrees.
STEP_M, STEP_DEG = 0.01, 0.1
#: Pairs of passes, among which the paths are dealt out.
PAIRS = 4
FIELDS = ("image", "spot_histogram", "daylight_w", "spot_daylight_w", "spot_crosstalk_w")

#: Directions of the drone in its optical frame: x right, y down, z forward.
FORWARD, LEFT, UP = (
    np.array([0.0, 0.0, 1.0]),
    np.array([-1.0, 0.0, 0.0]),
    np.array([0.0, -1.0, 0.0]),
)
DIRECTIONS: Mapping[str, Floats] = {"forward_m": FORWARD, "left_m": LEFT, "up_m": UP}
#: Axes of turns: to the left, nose up, and clockwise as the drone sees it.
AXES: Mapping[str, Floats] = {"yaw_deg": UP, "pitch_deg": -LEFT, "roll_deg": FORWARD}


@dataclass(frozen=True, eq=False)
class Displacement:
    """Derivative by a coordinate, from differences: each field with its standard error."""

    parameter: str
    unit: str  # of one over the parameter
    fields: Mapping[str, tuple[NDArray[np.float64], Floats]]
    weights: tuple[Score, ...] = field(default=(), init=False)

    def of(self, light: Transport, name: str = "image") -> tuple[NDArray[np.float64], Floats]:
        """Derivative and standard error of a field of `Transport`, one of `FIELDS`."""
        return self.fields[name]


def displacements(
    scene: Scene,
    instrument: Instrument,
    parameters: Sequence[str],
    light: Transport,
    *,
    spp: int = 256,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> list[Displacement]:
    """Derivatives of light by coordinates of the drone and of objects.

    Parameters
    ----------
    scene, instrument
        As of `solve`.
    parameters
        Names of `coordinates_of` the scene: ``drone.forward_m``, ``drone.left_m``, ``drone.up_m``,
        ``drone.yaw_deg``, ``drone.pitch_deg``, ``drone.roll_deg`` along and about the drone's own
        axes, ``objects.NAME.x_m`` and so on along those of the world.
    light
        Of the scene itself, whose bins of path length the derivatives take.
    spp
        Light paths per virtual pixel, of all pairs together at either end of a step.
    seed
        Equal seeds give equal derivatives.
    progress
        Called with the completed fraction.

    Raises
    ------
    InputError
        For an unknown name, and as `solve`.
    """
    require_known(scene, parameters)
    known = coordinates_of(scene)
    own = max(1, -(-spp // PAIRS))
    seeds = [int(each.generate_state(1)[0]) for each in np.random.SeedSequence(seed).spawn(PAIRS)]
    result = []
    for number, name in enumerate(parameters):
        step, unit = (STEP_DEG, "1/deg") if name.endswith("_deg") else (STEP_M, "1/m")
        pairs = []
        for done, own_seed in enumerate(seeds):
            high, low = (
                _arrays(solve(known[name](sign * step), instrument, spp=own, seed=own_seed), light)
                for sign in (1, -1)
            )
            pairs.append([(one - other) / (2 * step) for one, other in zip(high, low, strict=True)])
            if progress is not None:
                progress((number + (done + 1) / PAIRS) / len(parameters))
        fields = {
            each: (np.mean(values, axis=0), np.std(values, axis=0, ddof=1) / np.sqrt(PAIRS))
            for each, values in zip(FIELDS, zip(*pairs, strict=True), strict=True)
        }
        result.append(Displacement(name, unit, fields))
    return result


def coordinates_of(scene: Scene) -> dict[str, Callable[[float], Scene]]:
    """The scene moved by some metres or degrees, by the name of each coordinate."""
    known: dict[str, Callable[[float], Scene]] = {}
    for name, along in DIRECTIONS.items():
        known[f"drone.{name}"] = partial(_shifted, scene, along)
    for name, about in AXES.items():
        known[f"drone.{name}"] = partial(_turned, scene, about)
    for number, thing in enumerate(scene.objects):
        for axis, along in zip("xyz", np.eye(3), strict=True):
            known[f"objects.{thing.name}.{axis}_m"] = partial(_with_object, scene, number, along)
    return known


def require_known(scene: Scene, parameters: Sequence[str]) -> None:
    """Raise InputError for a name that is none of `coordinates_of`, with the nearest."""
    known = coordinates_of(scene)
    for name in parameters:
        if name not in known:
            raise InputError(f"sensitivity {name!r}: {nearest(name, known)}")


def is_coordinate(name: str) -> bool:
    """Whether a name is that of a coordinate, known or not."""
    return name.startswith(("drone.", "objects."))


def _arrays(moved: Transport, light: Transport) -> list[NDArray[np.float64]]:
    """`FIELDS` of one end of a step."""
    arrays = [np.asarray(getattr(moved, name), np.float64) for name in FIELDS]
    arrays[FIELDS.index("spot_histogram")] = _rebinned(moved, light.path_length_m)
    return arrays


def _rebinned(moved: Transport, lengths_m: Floats) -> Floats:
    """Light of the spots in other bins, as bins far away follow the surfaces; their mean stays."""
    own_m, light = moved.path_length_m, moved.spot_histogram
    if np.array_equal(own_m, lengths_m):
        return light
    low = np.clip(np.searchsorted(lengths_m, own_m, side="right") - 1, 0, len(lengths_m) - 2)
    upper = np.clip((own_m - lengths_m[low]) / (lengths_m[low + 1] - lengths_m[low]), 0, 1)
    rebinned = np.zeros((len(light), len(lengths_m)))
    for spot, own in enumerate(light):
        rebinned[spot] += np.bincount(low, own * (1 - upper), len(lengths_m))
        rebinned[spot] += np.bincount(low + 1, own * upper, len(lengths_m))
    return rebinned


def _shifted(scene: Scene, along: Floats, by_m: float) -> Scene:
    """The drone elsewhere, along a direction of its own frame."""
    own = np.eye(4)
    own[:3, 3] = by_m * along
    return replace(scene, drone_pose=scene.drone_pose @ own)


def _turned(scene: Scene, about: Floats, by_deg: float) -> Scene:
    """The drone turned, about an axis of its own frame."""
    own = np.eye(4)
    own[:3, :3] = Rotation.from_rotvec(np.radians(by_deg) * about).as_matrix()
    return replace(scene, drone_pose=scene.drone_pose @ own)


def _with_object(scene: Scene, number: int, along: Floats, by_m: float) -> Scene:
    """One of the objects elsewhere, along a direction of the world."""
    things = list(scene.objects)
    mesh = things[number].mesh.copy()
    mesh.apply_translation(by_m * along)
    things[number] = replace(things[number], mesh=mesh)
    return replace(scene, objects=tuple(things))
