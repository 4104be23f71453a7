"""Fit what surrogate light adds to light scattered once, and report its distance from traced light.

    python tools/surrogate_fit.py [--seeds 7000 7003] [--families FAMILY ...]

Traces drawn scenes, clear and in fog of 30 to 600 m, and prints the shares of
`spisim.simulation.light.surrogate` that fit the families to learn from, by least squares of mean
light over that traced, and for each weather the distance on all other families: correlation
and relative bias of the image, and bias of the spots' ranges by the phase at 15 MHz.
"""

import argparse
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.constants import c
from scipy.ndimage import gaussian_filter
from scipy.optimize import nnls

from drawn_images import FITTED
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere import fog
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene, draw_scene
from spisim.scene.families import FAMILIES
from spisim.simulation.light import Transport, solve
from spisim.simulation.light.surrogate import (
    AROUND,
    BESIDE,
    ECHO,
    by_order,
    image_once,
    mean_path_m,
    surrogate,
)
from spisim.transport.world import build_world

VISIBILITIES_M = (30.0, 75.0, 150.0, 300.0, 600.0)
SPP = {"clear": 32, "fog": 96}
PHASE_HZ = 15e6


def main() -> None:
    """Print constants and distances."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, nargs=2, default=(7000, 7003), metavar="N")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES))
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    instrument = load_instrument("paper")
    rows, rests, distances = [], [], []
    for family, visibility_m, scene, seed in scenes(range(*asked.seeds), asked.families):
        traced = solve(scene, instrument, spp=SPP["fog" if visibility_m else "clear"], seed=seed)
        if family in FITTED:
            row, rest = fractions(scene, instrument, traced)
            rows.append(row)
            rests.append(rest)
        else:
            reported = distance(surrogate(scene, instrument, seed=seed), traced)
            distances.append((visibility_m, *reported))
    if rows:
        print("BOUNCED, FORWARD, AGAIN_M:", fitted(np.array(rows), np.array(rests)))
    print("visibility m; quartiles of correlation, relative bias of the image, bias of ranges, m")
    for visibility_m in (None, *VISIBILITIES_M):
        some = np.array([each[1:] for each in distances if each[0] == visibility_m])
        if len(some):
            quartiles = np.nanpercentile(some, [25, 50, 75], axis=0).T.round(4).tolist()
            print(visibility_m or "clear", len(some), quartiles, flush=True)


def fitted(rows: Floats, rests: Floats) -> list[float]:
    """The constants: of clear scenes the median, then by least squares those of the fog."""
    clear = rows[:, 1] == 0
    bounced = float(np.median(rests[clear] / rows[clear, 0]))
    foggy, _ = nnls(rows[~clear, 1:], rests[~clear] - bounced * rows[~clear, 0])
    return [round(each, 3) for each in (bounced, *foggy.tolist())]


def scenes(seeds: range, families: Sequence[str]) -> Iterator[tuple[str, float | None, Scene, int]]:
    """Family, visibility, scene and seed: each family clear and in one of the fogs."""
    for seed in seeds:
        for number, family in enumerate(families):
            try:
                scene = draw_scene(family, seed)
            except InputError:
                continue
            yield family, None, scene, seed
            visibility_m = VISIBILITIES_M[(seed + number) % len(VISIBILITIES_M)]
            air = fog(visibility_m, "moderate-radiation", wavelength_nm=scene.wavelength_nm)
            yield family, visibility_m, replace(scene, atmosphere=air), seed


def fractions(scene: Scene, instrument: Instrument, traced: Transport) -> tuple[Floats, float]:
    """What each constant is multiplied by, and what they are to explain, over all light."""
    placed, world = InstrumentView.placed(scene, instrument), build_world(scene)
    sums = image_once(world, placed, (), np.random.SeedSequence(0))
    once, waves = by_order(sums.mean, placed.projector.shape)
    side, extinction = max(placed.projector.shape), scene.atmosphere.extinction_per_m
    surfaces, echo = once[0], gaussian_filter(once[1], ECHO * side)
    beside = gaussian_filter(extinction * mean_path_m(waves[0, -1]) * surfaces, BESIDE * side)
    around = gaussian_filter(surfaces, AROUND * side)
    total = float(traced.image.mean())
    row = np.array([around.mean(), beside.mean(), extinction * echo.mean()]) / total
    return row, 1 - float(surfaces.mean() + echo.mean()) / total


def distance(guessed: Transport, traced: Transport) -> tuple[float, float, float]:
    """Correlation and relative bias of the image, and the mean bias of the spots' ranges, m.

    The correlation is that with the light traced without its own error.
    """
    between = np.cov(guessed.image.ravel(), traced.image.ravel())
    own = between[1, 1] - float(np.mean(traced.image_error**2))
    correlation = float(between[0, 1] / np.sqrt(between[0, 0] * own)) if own > 0 else np.nan
    bias = float(guessed.image.mean() / traced.image.mean() - 1)
    paths = [_path_m(light) for light in (guessed, traced)]
    apart = np.angle(np.exp(1j * (paths[0] - paths[1]) * 2 * np.pi * PHASE_HZ / c))
    return correlation, bias, float(np.nanmean(apart) * c / (4 * np.pi * PHASE_HZ))


def _path_m(light: Transport) -> Floats:
    wave = light.spot_histogram @ np.exp(2j * np.pi * PHASE_HZ / c * light.path_length_m)
    return np.where(np.abs(wave) > 0, np.angle(wave) * c / (2 * np.pi * PHASE_HZ), np.nan)


if __name__ == "__main__":
    main()
