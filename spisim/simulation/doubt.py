"""What the last depth map leaves open, for mirrors that follow it."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture import Optics
from reconstruction.depth import pixel_of
from reconstruction.reconstructor import Reconstructor
from spisim.instrument import Instrument
from spisim.instrument.steering import Doubt, directions
from spisim.scene import Scene
from spisim.simulation.light import LightSequence, Steered
from spisim.simulation.measurement import record
from spisim.transport import ground_truth

#: Random stream of the readings that the maps are made of.
STREAM = 5


class MapDoubt:
    """Records and reconstructs every frame at once, as a rig with such mirrors must.

    The readings have other noise than those of the capture, and each frame the first patterns.
    """

    def __init__(
        self, scene: Scene, instrument: Instrument, light: LightSequence, seed: int
    ) -> None:
        instrument.imaging  # noqa: B018 - raises for an instrument without an image
        self._scene, self._instrument, self._light, self._seed = scene, instrument, light, seed
        self._reconstruct: Reconstructor | None = None

    def __call__(self, frame: int, steered: Steered) -> Doubt | None:
        """Sigma of ln depth by direction; None if no depth method states one."""
        start_s = frame * self._instrument.frame_time_s
        scene = self._scene.at(start_s)
        light = replace(self._light, times_s=self._light.times_s - start_s)
        truth = ground_truth(scene, self._instrument, subpixels=1)
        stream = np.random.SeedSequence(self._seed, spawn_key=(STREAM, frame))
        capture = record(
            scene, self._instrument, light, [truth], seed=int(stream.generate_state(1)[0]),
            steered=steered,
        )  # fmt: skip
        if self._reconstruct is None:
            self._reconstruct = Reconstructor(capture.setup)
        try:
            sigmas = self._reconstruct(capture.frame(0)).log_depth_sigmas
        except InputError:  # no usable reading
            return None
        assert capture.optics is not None
        return next((_by_direction(each, capture.optics) for each in sigmas.values()), None)


def _by_direction(sigma: NDArray[Any], optics: Optics) -> Doubt:
    """Sigma (H, W) at azimuths and elevations; the largest where it is unknown, 0 outside."""
    known = np.nan_to_num(sigma, nan=float(np.nanmax(sigma, initial=0.0)))

    def doubt(angles_deg: Floats) -> Floats:
        flat = directions(angles_deg).reshape(-1, 3)
        pixel = np.round(pixel_of(flat, optics, sigma.shape)).astype(np.intp)
        inside = ((pixel >= 0) & (pixel < sigma.shape)).all(axis=1)
        row, column = np.clip(pixel, 0, np.array(sigma.shape) - 1).T
        return np.where(inside, known[row, column], 0.0).reshape(angles_deg.shape[:-1])

    return doubt
