"""What a small network makes of image, ranges and fog: depth, how sure it is, and where is nothing.

It was trained on drawn scenes, open and closed, in clear air and in fog, by
`tools/depth_network.py`; see `reconstruction.depth.network_input` for what it is given. Where every
pattern has taps, its map and the measured one are joined by their inverse variances, as both are
normal in log depth. Of what is unlike all that the network was trained on it is not asked: the map
is then the one anchored on the spots, and a note says why.
"""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...capture import Setup
from ...capture.readings.cw import CwSpots
from ..method import Context, DepthEstimate, DepthSolver, Need, View
from ..network import DepthNetwork, load, of_view
from ..network_input import inputs_of, of_fraction
from ..observer import Observer
from ..obstacle import Corridor, corridor_prior
from ..pixels import pixel_rays
from .anchored import METHOD as ANCHORED
from .dense import METHOD as DENSE

WEIGHTS = Path(__file__).parents[1] / "learned.npz"
MAX_NO_RETURN = 0.2
"""Probability of nothing from which on a pixel has no depth: one invented costs four lost ones."""


class Learned:
    """Depth, its deviation and the probability of nothing, learned from scenes."""

    title = "learned"
    needs: tuple[Need, ...] = ("optics", "spots")

    def out_of_distribution(self, setup: Setup) -> str | None:
        """Why no frame of a recording is like those learned from, in words; None if some may be."""
        if not isinstance(setup.spots, CwSpots):
            return "learned from spots of continuous wave alone"
        assert setup.optics is not None
        shape = setup.plan.shape
        fraction = of_fraction(setup.plan.exposures / (shape[0] * shape[1]))
        try:
            network = shipped()
        except InputError as error:
            return str(error)
        return network.outside(
            {"share": fraction} | of_view(shape, setup.optics, setup.spots.directions)
        )

    def compile(self, context: Context) -> DepthSolver:
        """Solver of one recording's frames."""
        anchored = ANCHORED.compile(context)
        out_of_distribution = self.out_of_distribution(context.setup)
        if out_of_distribution is not None:
            return _Fallback(anchored, out_of_distribution)
        dense = None if context.setup.pattern_taps is None else DENSE.compile(context)
        assert context.setup.optics is not None
        corridor = Corridor(pixel_rays(context.setup.optics, context.setup.plan.shape))
        return LearnedSolver(shipped(), Observer.of(context.setup), anchored, dense, corridor)


class LearnedSolver:
    """Holds what depends on the recording alone."""

    def __init__(
        self,
        network: DepthNetwork,
        observer: Observer,
        anchored: DepthSolver,
        dense: DepthSolver | None,
        corridor: Corridor,
    ) -> None:
        self._network, self._observer = network, observer
        self._anchored, self._dense, self._corridor = anchored, dense, corridor

    def __call__(self, view: View) -> DepthEstimate | None:
        """The map, or the anchored one of a view unlike those learned from."""
        if view.ranges is None:
            return None
        frame = self._observer(view)
        if not frame.bright > 0:
            return _Fallback(self._anchored, "the image is dark")(view)
        inputs = inputs_of(frame)
        out_of_distribution = self._network.out_of_distribution(inputs)
        if out_of_distribution is not None:
            return _Fallback(self._anchored, out_of_distribution)(view)
        prediction = self._network(inputs)
        if not frame.ranged:
            unknown = np.full(prediction.no_return.shape, np.nan)
            return DepthEstimate(
                unknown, None, prediction.no_return, "no spot has a range: no depth"
            )
        result = DepthEstimate(np.exp(prediction.log_depth), prediction.sigma, prediction.no_return)
        measured = None if self._dense is None else self._dense(view)
        return self._decided(result if measured is None else fused(result, measured))

    def _decided(self, result: DepthEstimate) -> DepthEstimate:
        """No depth where nothing is likely; the corridor is judged by all depths together."""
        assert result.no_return is not None
        prior = corridor_prior("learned")
        return replace(
            result,
            depth_m=np.where(result.no_return > MAX_NO_RETURN, np.nan, result.depth_m),
            free=self._corridor.free(result.depth_m, prior, result.sigma, result.no_return),
        )


def fused(result: DepthEstimate, measured: DepthEstimate) -> DepthEstimate:
    """Two estimates of log depth, normal and independent, as one; the first is of all pixels.

    What is measured is there: nothing is not likely any more.
    """
    assert result.sigma is not None
    assert result.no_return is not None
    assert measured.sigma is not None
    finite = np.isfinite(measured.depth_m) & np.isfinite(measured.sigma)
    weight = np.where(finite, measured.sigma, np.inf) ** -2.0
    prior = result.sigma**-2.0
    total = weight + prior
    log = weight * np.log(np.where(finite, measured.depth_m, 1)) + prior * np.log(result.depth_m)
    return replace(
        result,
        depth_m=np.exp(log / total),
        sigma=total**-0.5,
        no_return=np.where(finite, np.minimum(result.no_return, MAX_NO_RETURN), result.no_return),
    )


class _Fallback:
    """The anchored map, with a note that says why it is not the learned one."""

    def __init__(self, anchored: DepthSolver, why: str) -> None:
        self._anchored, self._why = anchored, why

    def __call__(self, view: View) -> DepthEstimate | None:
        """That map, or no depth at all."""
        note = f"not learned: {self._why}"
        result = self._anchored(view)
        if result is None:
            return DepthEstimate(np.full(view.image.shape, np.nan), note=f"no depth; {note}")
        return replace(result, note=f"anchored on the spots, {note}")


@lru_cache(maxsize=1)
def shipped() -> DepthNetwork:
    """The network of this package."""
    return load(WEIGHTS)


METHOD = Learned()
