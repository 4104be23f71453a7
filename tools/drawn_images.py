"""Images of drawn scenes, as projector and bucket detector see them: what tools here learn from.

    python tools/drawn_images.py images.npz [--seeds 1000 1012] [--views 3] [--fog]

Every family, every seed, several views; clear air, or fog of 30 to 300 m of visibility. The file
has `image` (n, H, W), fractions of the power of a pixel that come back, and `family`, `seed` and
`view` of each. Views from within something are left out.
"""

import argparse
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument import load_instrument
from spisim.scene import draw_scene
from spisim.scene.families import FAMILIES
from spisim.simulation.light import solve

FITTED = (
    "forest-trail",
    "hovering-drone",
    "person",
    "reflective-shelf",
    "scaffold",
    "street-canyon",
    "warehouse",
)
"""Families to learn from; what is learned is judged on the others."""
SPP = {"clear": 16, "fog": 64}
OFFSET_M = 0.2
ROLL_DEG, PITCH_DEG, YAW_DEG = 3.0, 8.0, 20.0


def main() -> None:
    """Draw what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--seeds", type=int, nargs=2, default=(1000, 1012), metavar="N")
    parser.add_argument("--views", type=int, default=3)
    parser.add_argument("--fog", action="store_true")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    result = list(drawn(range(*asked.seeds), asked.views, fog=asked.fog))
    names = ("family", "seed", "view", "image")
    columns = map(np.array, zip(*result, strict=True))
    np.savez_compressed(asked.file, **dict(zip(names, columns, strict=True)))


def drawn(seeds: range, views: int, *, fog: bool) -> Iterator[tuple[str, int, int, Floats]]:
    """Family, seed, view and image."""
    instrument = load_instrument("paper")
    for seed in seeds:
        for family in FAMILIES:
            for view in range(views):
                rng = np.random.default_rng([seed, view, len(family)])
                changes = _view(rng) if view else {}
                if fog:
                    visibility_m = float(np.exp(rng.uniform(np.log(30), np.log(300))))
                    changes["fog"] = {"kind": "moderate-radiation", "visibility_m": visibility_m}
                try:
                    scene = draw_scene(family, seed, changes=changes)
                    light = solve(scene, instrument, spp=SPP["fog" if fog else "clear"], seed=seed)
                except InputError:
                    continue
                yield family, seed, view, light.image.astype(np.float32)


def _view(rng: np.random.Generator) -> dict[str, Any]:
    """Section of a scene file: the drone turned and moved a little."""
    maximum = (ROLL_DEG, PITCH_DEG, YAW_DEG)
    turn = [float(rng.uniform(-limit, limit)) for limit in maximum]
    return {"drone": {"turn_deg": turn, "offset_m": rng.uniform(-OFFSET_M, OFFSET_M, 3).tolist()}}


if __name__ == "__main__":
    main()
