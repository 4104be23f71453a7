"""What a small network makes of image, ranges and fog: depth, how sure it is, and where is nothing.

It was trained on drawn scenes, open and closed, in clear air and in fog, by
`tools/depth_network.py`; see `reconstruction.depth.shown` for what it is given. Where every pattern
has taps, its map and the measured one are joined by their inverse variances, as both are normal in
log depth. Of what is unlike all that the network was trained on it is not asked: the map is then
the one anchored on the spots, and a note says why.
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
from ..observer import Observer
from ..obstacle import Corridor, corridor_prior
from ..rays import pixel_rays
from ..shown import inputs_of, of_share
from .anchored import METHOD as ANCHORED
from .dense import METHOD as DENSE

WEIGHTS = Path(__file__).parents[1] / "learned.npz"
LIKELY = 0.2
"""Probability of nothing from which on a pixel has no depth: one invented costs four lost ones."""


class Learned:
    """Depth, its deviation and the probability of nothing, learned from scenes."""

    title = "learned"
    needs: tuple[Need, ...] = ("optics", "spots")

    def unlike(self, setup: Setup) -> str | None:
        """Why no frame of a recording is like those learned from, in words; None if some may be."""
        if not isinstance(setup.spots, CwSpots):
            return "learned from spots of continuous wave alone"
        assert setup.optics is not None
        shape = setup.plan.shape
        share = of_share(setup.plan.exposures / (shape[0] * shape[1]))
        try:
            network = shipped()
        except InputError as error:
            return str(error)
        return network.outside(
            {"share": share} | of_view(shape, setup.optics, setup.spots.directions)
        )

    def compile(self, context: Context) -> DepthSolver:
        """Solver of one recording's frames."""
        anchored = ANCHORED.compile(context)
        unlike = self.unlike(context.setup)
        if unlike is not None:
            return _Instead(anchored, unlike)
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
        shown = self._observer(view)
        if not shown.bright > 0:
            return _Instead(self._anchored, "the image is dark")(view)
        inputs = inputs_of(shown)
        unlike = self._network.unlike(inputs)
        if unlike is not None:
            return _Instead(self._anchored, unlike)(view)
        told = self._network(inputs)
        if not shown.ranged:
            unknown = np.full(told.nothing.shape, np.nan)
            return DepthEstimate(unknown, None, told.nothing, "no spot has a range: no depth")
        found = DepthEstimate(np.exp(told.log_depth), told.deviation, told.nothing)
        measured = None if self._dense is None else self._dense(view)
        return self._decided(found if measured is None else joined(found, measured))

    def _decided(self, found: DepthEstimate) -> DepthEstimate:
        """No depth where nothing is likely; the corridor is judged by all depths together."""
        assert found.nothing is not None
        prior = corridor_prior("learned")
        return replace(
            found,
            depth_m=np.where(found.nothing > LIKELY, np.nan, found.depth_m),
            free=self._corridor.free(found.depth_m, prior, found.deviation, found.nothing),
        )


def joined(found: DepthEstimate, measured: DepthEstimate) -> DepthEstimate:
    """Two estimates of log depth, normal and independent, as one; the first is of all pixels.

    What is measured is there: nothing is not likely any more.
    """
    assert found.deviation is not None
    assert found.nothing is not None
    assert measured.deviation is not None
    known = np.isfinite(measured.depth_m) & np.isfinite(measured.deviation)
    weight = np.where(known, measured.deviation, np.inf) ** -2.0
    prior = found.deviation**-2.0
    total = weight + prior
    log = weight * np.log(np.where(known, measured.depth_m, 1)) + prior * np.log(found.depth_m)
    return replace(
        found,
        depth_m=np.exp(log / total),
        deviation=total**-0.5,
        nothing=np.where(known, np.minimum(found.nothing, LIKELY), found.nothing),
    )


class _Instead:
    """The anchored map, with a note that says why it is not the learned one."""

    def __init__(self, anchored: DepthSolver, why: str) -> None:
        self._anchored, self._why = anchored, why

    def __call__(self, view: View) -> DepthEstimate | None:
        """That map, or no depth at all."""
        note = f"not learned: {self._why}"
        found = self._anchored(view)
        if found is None:
            return DepthEstimate(np.full(view.image.shape, np.nan), note=f"no depth; {note}")
        return replace(found, note=f"anchored on the spots, {note}")


@lru_cache(maxsize=1)
def shipped() -> DepthNetwork:
    """The network of this package."""
    return load(WEIGHTS)


METHOD = Learned()
