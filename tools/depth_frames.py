"""Frames with their depths, of drawn scenes under surrogate light: what depths are learned from.

    python tools/depth_frames.py FOLDER [--scenes 0 3000] [--like MANIFEST.json]

Scene n of the plan is of its family n, counted round and round. Each file has the frames of one
scene: what the network sees of them (`NetworkInput`, by the name of its parts), and `depth_m`, nan
where there is nothing. Scenes that cannot be drawn, and poses in which a drone cannot be, are left
out. Equal plans and numbers give equal frames on the same machine, as long as the families draw
alike.
"""

import argparse
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture import Capture, Optics
from reconstruction.depth.method import MAX_RANGE_M, View
from reconstruction.depth.network_input import Anchors, NetworkInput
from reconstruction.depth.observer import Observer
from spisim.atmosphere import fog as made_fog
from spisim.base.config import dump_yaml, load_yaml
from spisim.base.config.distributions import stream
from spisim.dataset.values import drawn_value
from spisim.instrument import Instrument
from spisim.instrument.model import PRESETS
from spisim.scene import Scene
from spisim.scene.assemble import check_drone
from spisim.scene.load import make_scene
from spisim.scene.pose import pose_matrix
from spisim.simulation import simulate
from spisim.transport.backend import use_threads

PLAN = Path(__file__).with_name("learned_depth.yaml")
FAMILY_ASIDE = "scaffold"
"""The family that no network learns from."""
SCENES = 3000
IMAGE = "edge-preserving"
"""The method of the images that are shown."""
SCENE_SEEDS = 2**31


def main() -> None:
    """Draw what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--plan", type=Path, default=PLAN)
    parser.add_argument("--scenes", type=int, nargs=2, default=(0, SCENES), metavar="N")
    parser.add_argument("--like", type=Path, help="manifest of weights: make the scenes it lists")
    parser.add_argument("--families", nargs="+", help="make the scenes of these alone")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    use_threads(1)
    threadpool_limits(1)
    plan = load_yaml(asked.plan.read_text(), asked.plan)
    asked.folder.mkdir(parents=True, exist_ok=True)
    numbers: Sequence[int] = range(*asked.scenes)
    if asked.like is not None:
        fields = json.loads(asked.like.read_text())["scenes"].split()
        numbers = [number for number in map(int, fields) if number in numbers]
    for number in numbers:
        if asked.families and family_of(plan, number) not in asked.families:
            continue
        file = asked.folder / f"{number:05}.npz"
        result = [] if file.exists() else list(frames_of(plan, number))
        if result:
            part = file.with_suffix(".part")
            with part.open("wb") as to:
                np.savez(
                    to, **{name: np.array([each[name] for each in result]) for name in result[0]}
                )
            part.rename(file)


def frames_of(plan: Mapping[str, Any], number: int) -> Iterator[dict[str, Any]]:
    """The frames of one scene of a plan."""
    seed, family = plan["seed"], family_of(plan, number)
    drawn = int(stream(seed, "family", number).integers(SCENE_SEEDS))
    instrument = instrument_of(drawn_value(plan["instrument"], seed, "instrument", number))
    text = dump_yaml({"family": family, "seed": drawn})
    try:
        scene = make_scene(text, Path(), f"scene {number}", wavelength_nm=instrument.wavelength_nm)
    except InputError:
        return
    reconstructor = None
    for pose in range(plan["poses"]):
        look = {
            name: drawn_value(value, seed, name, number, pose)
            for name, value in plan["pose"].items()
        }
        try:
            placed = moved(scene, **look)
            capture = simulate(
                placed, instrument, light="surrogate", seed=number * plan["poses"] + pose
            ).capture
            if reconstructor is None:
                reconstructor = Reconstructor(capture.setup, image=IMAGE, depth=())
                observer = Observer.of(capture.setup)
            displayed = seen(capture, reconstructor, observer)
        except InputError:
            continue
        extinction = placed.atmosphere.extinction_per_m
        yield {"family": family, "seed": drawn, "extinction": extinction} | columns(
            displayed, capture
        )


def family_of(plan: Mapping[str, Any], number: int) -> str:
    """Of a scene of a plan."""
    return str(plan["families"][number % len(plan["families"])])


def moved(scene: Scene, turn_deg: Floats, offset_m: Floats, fog: Mapping[str, Any] | None) -> Scene:
    """The scene from elsewhere: moved and turned about the optical axes x, y and z; in fog."""
    step = pose_matrix(turn_deg, offset_m)
    air = scene.atmosphere
    if fog is not None:
        air = made_fog(**fog, wavelength_nm=scene.wavelength_nm)
    elsewhere = replace(scene, drone_pose=scene.drone_pose @ step, atmosphere=air)
    check_drone(elsewhere, scene.name)
    return elsewhere


def seen(capture: Capture, reconstructor: Reconstructor, observer: Observer) -> NetworkInput:
    """What the network sees of the first frame of a capture."""
    result = reconstructor(capture.frame(0))
    return observer(View(result.image.astype(np.float64), result.ranges, capture.frame(0)))


def columns(displayed: NetworkInput, capture: Capture) -> dict[str, Any]:
    """A frame as plain arrays."""
    truth = capture.truth
    assert truth is not None
    depth_m: Floats = truth.depth_m[0]
    near = np.where(depth_m <= MAX_RANGE_M, depth_m, np.nan)
    return to_arrays(displayed) | {"depth_m": near.astype(np.float32)}


def to_arrays(displayed: NetworkInput) -> dict[str, Any]:
    """The parts of `NetworkInput`, as `from_arrays` takes them."""
    reported = dict(vars(displayed))
    optics = reported.pop("optics")
    anchors = [*reported.pop("plain"), *reported.pop("fitted")]
    return reported | {
        "image": displayed.image.astype(np.float32),
        "slopes": np.array([optics.tan_half_width, optics.tan_half_height]),
        "anchors": np.array(anchors),
    }


def from_arrays(reported: dict[str, Any]) -> NetworkInput:
    """The result of `to_arrays`."""
    names = ("noise", "fraction", "max_range_m", "extinction_per_m", "backscatter_per_m_sr")
    return NetworkInput(
        image=reported["image"].astype(np.float64),
        optics=Optics(*reported["slopes"].tolist()),
        directions=reported["directions"],
        plain=Anchors(*reported["anchors"][:2]),
        fitted=Anchors(*reported["anchors"][2:]),
        lost=reported["lost"],
        log_reflectance=reported["log_reflectance"],
        **{name: float(reported[name]) for name in names},
    )


def instrument_of(drawn: Mapping[str, Any]) -> Instrument:
    """A preset with what the plan changes of it."""
    file = PRESETS / f"{drawn['preset']}.yaml"
    fields = load_yaml(file.read_text(), file)
    projector, detector = fields["projector"], fields["detector"]
    wider = drawn["fov_deg"] / projector["fov_deg"]
    projector["fov_deg"] = drawn["fov_deg"]
    detector["field_of_view_deg"] *= max(wider, 1.0)
    projector["power_w"] *= drawn["light"]
    fields["lasers"]["power_w"] *= drawn["lasers"]
    fields["plan"]["patterns"] = round(drawn["patterns"])
    half = drawn["fov_deg"] / 2
    fields["lasers"]["directions_deg"] = (half * np.array(drawn["spots"])).tolist()
    frequencies = fields["tof"]["modulation"]["frequencies_hz"]
    if len(frequencies) == 1:
        fields["tof"]["modulation"]["frequencies_hz"] = [1e6 * drawn["frequency_mhz"]]
    return Instrument.model_validate(fields)


if __name__ == "__main__":
    main()
