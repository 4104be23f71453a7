"""What a picture of a foggy scene costs: both ends of the light, and Mitsuba's `volpath`.

    python benchmarks/picture.py [--quick] [--json] [--markdown]

The warehouse, lit by the projector alone, seen by a camera 5 cm above it with 64 × 64 pixels, in
turns by both. *Noise* is ‖standard deviations‖ / ‖means‖ of the pixels over independent pictures,
*typical* its median over the pixels; `volpath` has no finite variance there, so that its noise
depends on how many of the rare bright paths were met. `--markdown` pastes the tables into
docs/results/transport.md.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mitsuba_reference import Renderer, pattern_emitter
from numpy.typing import NDArray
from options import benchmark_options, finish

from spisim.instrument import Instrument, load_instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene, load_scene
from spisim.transport import camera_view
from spisim.transport.backend import activate
from spisim.transport.engine.ends import Projector
from spisim.transport.picture import camera_at
from spisim_paper.checks import Check, Table, surroundings

activate()
import drjit as dr  # noqa: E402 - the variant comes first
import mitsuba as mi  # noqa: E402

DOCS = Path(__file__).parents[1] / "docs" / "results" / "transport.md"
VISIBILITIES_M = (50.0, 20.0, 5.0)
SIDE = 64
SPP = {"two-ended": 64, "volpath": 512}
TURNS = 20
MIN_GAIN = 10.0

Renders = Callable[[int], NDArray[np.float64]]


@dataclass(frozen=True)
class Cost:
    """Pictures (n, H, W) of one method, and the mean processor time of one."""

    pictures: NDArray[np.float64]
    seconds: float

    @property
    def noise(self) -> float:
        """Norm of the pixels' standard deviations over that of their means."""
        spread = np.linalg.norm(self.pictures.std(axis=0, ddof=1))
        return float(spread / np.linalg.norm(self.pictures.mean(axis=0)))

    @property
    def typical(self) -> float:
        """Median relative standard deviation of a pixel."""
        return float(np.median(self.pictures.std(axis=0, ddof=1) / self.pictures.mean(axis=0)))

    @property
    def squared(self) -> float:
        """Noise² × time."""
        return self.noise**2 * self.seconds


def main() -> int:
    """Noise and time by visibility and method."""
    options = benchmark_options(__doc__, "one visibility, six turns", DOCS)
    instrument = load_instrument("paper")
    rows, checks = [], []
    for visibility_m in VISIBILITIES_M[:1] if options.quick else VISIBILITIES_M:
        changes = {"fog": {"kind": "moderate-radiation", "visibility_m": visibility_m}}
        scene = load_scene("warehouse", changes=changes)
        dark = replace(scene.ambient, sun_klx=0.0, sky_klx=0.0)
        result = in_turns(replace(scene, ambient=dark), instrument, 6 if options.quick else TURNS)
        rows += [(f"{visibility_m:g} m", *row(name, cost)) for name, cost in result.items()]
        gain = result["volpath"].squared / result["two-ended"].squared
        name = f"noise² × time of volpath over ours, {visibility_m:g} m"
        checks.append(Check(name, gain, MIN_GAIN, at_least=True))
    columns = ("visibility", "method", "spp", "noise", "typical", "time, s", "mean, W/(m² sr)")
    table = Table("A picture in lit fog:", columns, rows)
    around = surroundings(("spisim", "mitsuba", "drjit", "numpy"))
    return finish(options, DOCS, "picture", around, [table], checks)


def row(name: str, cost: Cost) -> tuple[str, ...]:
    """One method's, as text."""
    totals = cost.pictures.mean(axis=(1, 2))
    mean = f"{totals.mean():.3f} ± {totals.std(ddof=1) / np.sqrt(len(totals)):.3f}"
    figures = (f"{cost.noise:.3f}", f"{cost.typical:.3f}", f"{cost.seconds:.2f}")
    return (name, str(SPP[name]), *figures, mean)


def in_turns(scene: Scene, instrument: Instrument, turns: int) -> dict[str, Cost]:
    """Pictures by both methods, one after the other; the first of each is not counted."""
    work = {"two-ended": ours(scene, instrument), "volpath": theirs(scene, instrument)}
    pictures: dict[str, list[NDArray[np.float64]]] = {name: [] for name in work}
    seconds = dict.fromkeys(work, 0.0)
    for turn in range(turns + 1):
        for name, render in work.items():
            began = time.process_time()
            picture = render(turn)
            if turn > 0:
                seconds[name] += (time.process_time() - began) / turns
                pictures[name].append(picture)
    return {name: Cost(np.array(pictures[name]), seconds[name]) for name in work}


def ours(scene: Scene, instrument: Instrument) -> Renders:
    """As `spisim picture` makes it."""

    def render(seed: int) -> NDArray[np.float64]:
        view = camera_view(
            scene, instrument, width=SIDE, height=SIDE, spp=SPP["two-ended"], seed=seed
        )
        return view.astype(np.float64)

    return render


def theirs(scene: Scene, instrument: Instrument) -> Renders:
    """By Mitsuba's path tracer, whose scene is loaded once."""
    projector = InstrumentView.placed(scene, instrument).projector
    camera, count = camera_at(scene, projector, SIDE, SIDE), SPP["volpath"]
    power_w = float(instrument.pixel_powers_w.mean())
    renderer = Renderer(scene, {"projector": pattern_emitter(projector, power_w)})
    lanes = count * camera.pixels

    def render(seed: int) -> NDArray[np.float64]:
        sampler: Any = mi.load_dict({"type": "independent"})
        sampler.seed(dr.opaque(mi.UInt32, seed), lanes)
        ray, _ = Projector.of(camera, count).pencil(dr.arange(mi.UInt32, lanes), sampler)
        radiance = renderer.radiance(ray.o, ray.d, sampler).numpy()
        return np.asarray(radiance, float).reshape(count, SIDE, SIDE).mean(axis=0)

    return render


if __name__ == "__main__":
    sys.exit(main())
