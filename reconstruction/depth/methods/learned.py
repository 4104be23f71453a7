"""Depth, its uncertainty and the probability of no return, predicted by a small network.

The network was trained on synthetic scenes, open and closed, in clear air and in fog, by
`tools/depth_network.py`; see `reconstruction.depth.network_input` for its input. If every pattern
has taps, its map and the measured one are fused by inverse variance, both being normal in log
depth. Frames out of distribution get the map anchored on the spots, and a note says why.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.arrays import Floats
from ...base.errors import InputError
from ...capture import Setup
from ...capture.readings.cw import CwSpots
from ...capture.spots import USUAL_SPOTS
from ..ahead import Ahead
from ..completion import MAX_LOG_SIGMA, MapCompletion, Seen
from ..method import Context, DepthEstimate, DepthSolver, Need, View
from ..network import DepthNetwork, load, of_view
from ..network_input import (
    NetworkInput,
    four_spots,
    inputs_of,
    of_fraction,
    of_spots,
    raised,
)
from ..observer import Observer, brightness_noise
from ..pixels import in_view, pixel_of, pixel_rays
from .anchored import METHOD as ANCHORED
from .dense import METHOD as DENSE

WEIGHTS = Path(__file__).parents[1] / "learned.npz"
MAX_NO_RETURN = 0.2
"""Probability of no return above which a pixel has no depth: one invented depth costs four lost."""
DARK_SIGMAS = 5.0
"""Brightness of bright pixels below which an image is dark, in standard deviations of its mean."""
LOST_WEIGHT = 0.8
"""Weight of a spot without an echo among those that the network may see, 1 of a sure range."""
DARK_NOTE = "no light returns: there is open sky, or something before the lens"


class Learned:
    """Depth, its standard deviation and the probability of no return, learned from scenes."""

    title = "learned"
    needs: tuple[Need, ...] = ("optics", "spots")

    def out_of_distribution(self, setup: Setup) -> str | None:
        """Why no frame of a recording is in distribution, None if some may be."""
        if not isinstance(setup.spots, CwSpots):
            return "trained for continuous-wave spots only"
        assert setup.optics is not None
        shape, directions = setup.plan.shape, setup.spots.directions
        pixel = pixel_of(directions, setup.optics, shape)
        four = directions[four_spots(pixel, np.ones(len(pixel)), shape)]
        fraction = of_fraction(setup.plan.sampling_ratio)
        try:
            network = shipped()
        except InputError as error:
            return str(error)
        return network.outside(
            {"patterns over pixels": fraction} | of_view(shape, setup.optics, four)
        )

    def compile(self, context: Context) -> "LearnedSolver | Fallback":
        anchored = ANCHORED.compile(context)
        out_of_distribution = self.out_of_distribution(context.setup)
        if out_of_distribution is not None:
            return Fallback(anchored, out_of_distribution)
        dense = None if context.setup.pattern_taps is None else DENSE.compile(context)
        assert context.setup.optics is not None
        assert context.setup.spots is not None
        optics, shape = context.setup.optics, context.setup.plan.shape
        many = len(context.setup.spots.directions) > USUAL_SPOTS
        completion = MapCompletion(optics, shape) if many else None
        rays = pixel_rays(optics, shape)
        observer = Observer.of(context.setup)
        return LearnedSolver(shipped(), observer, anchored, dense, completion, rays)


class FrameMap(NamedTuple):
    """Map of a frame with all its pixels, and the input that it is from, if it is learned.

    The input has all spots, of which the network has seen four. In a ``dark`` frame neither
    patterns nor lasers return light.
    """

    estimate: DepthEstimate
    frame: NetworkInput | None = None
    dark: bool = False


@dataclass(frozen=True)
class LearnedSolver:
    """Solver with all that depends on the recording alone."""

    _network: DepthNetwork
    _observer: Observer
    _anchored: DepthSolver
    _dense: DepthSolver | None
    _completion: MapCompletion | None
    _rays: Floats

    def __call__(self, view: View) -> DepthEstimate | None:
        """Predicted map, or the anchored one for a view out of distribution."""
        whole = self.frame_map(view)
        if whole is None or whole.frame is None:
            return whole and whole.estimate
        if not whole.frame.ranged and not whole.dark:
            return without_depth(whole.estimate)
        result = whole.estimate
        if self._completion is not None and whole.frame.ranged:
            result = self._completion(view.image, result, seen_by(whole.frame))
        result = decided(result, Ahead.of(result, self._rays, "learned"))
        return result if whole.frame.ranged else without_depth(result)

    def frame_map(self, view: View) -> FrameMap | None:
        """Predicted map of all pixels, also of those that have no return; None without spots."""
        if view.ranges is None:
            return None
        frame, noise = self._observer(view), brightness_noise(view)
        dark = bool(frame.lost.all()) and abs(frame.bright) < DARK_SIGMAS * noise
        if not frame.bright > 0:
            if not dark:
                return Fallback(self._anchored, "the image is dark").frame_map(view)
            frame = raised(frame, noise)
        few = with_four_spots(frame)
        inputs = inputs_of(few)
        out_of_distribution = self._network.out_of_distribution(inputs)
        chosen = self._completion is not None or self._observer.spots.pointing is not None
        if out_of_distribution is None and chosen:
            rows, columns = view.image.shape
            seen = of_view((rows, columns), few.optics, few.directions)
            out_of_distribution = self._network.outside(seen)
        if out_of_distribution is not None:
            return Fallback(self._anchored, out_of_distribution).frame_map(view)
        prediction = self._network(inputs)
        depth_m = np.exp(prediction.log_depth)
        note = DARK_NOTE if dark else None
        result = DepthEstimate(depth_m, prediction.sigma, prediction.no_return, note)
        measured = None if self._dense is None or not frame.ranged else self._dense(view)
        return FrameMap(result if measured is None else fused(result, measured), frame, dark)


def with_four_spots(frame: NetworkInput) -> NetworkInput:
    """The frame with as many spots as the network learned from, some of them without an echo."""
    shape = frame.image.shape
    pixel = pixel_of(frame.directions, frame.optics, shape)
    for lost in (LOST_WEIGHT, 0.0):
        weight = np.where(frame.lost, lost, frame.best.weight)
        few = of_spots(frame, four_spots(pixel, weight, shape))
        if few.ranged:
            break
    return few


def seen_by(frame: NetworkInput) -> Seen:
    """What all spots of a frame have met."""
    best, pixel = frame.best, pixel_of(frame.directions, frame.optics, frame.image.shape)
    with np.errstate(invalid="ignore"):
        usable = (best.log_sigma < MAX_LOG_SIGMA) & ~frame.lost
    (index,) = np.nonzero(usable & in_view(pixel, frame.image.shape))
    log_variance, known = best.log_sigma[index] ** 2, best.log_depth[index]
    return Seen(index, pixel[index], known, log_variance, np.zeros(len(index)))


def without_depth(result: DepthEstimate) -> DepthEstimate:
    """A map without any range: its probabilities alone."""
    unknown = np.full(result.depth_m.shape, np.nan)
    notes = filter(None, ("no spot has a range: no depth", result.note))
    return replace(result, depth_m=unknown, sigma=None, note="; ".join(notes))


def decided(result: DepthEstimate, ahead: Ahead) -> DepthEstimate:
    """Drop depths where no return is probable; all depths together decide on corridors."""
    result = replace(result, free=ahead.free(), free_towards=ahead.free)
    if result.no_return is None:
        return result
    depth_m = np.where(result.no_return > MAX_NO_RETURN, np.nan, result.depth_m)
    return replace(result, depth_m=depth_m)


def fused(result: DepthEstimate, measured: DepthEstimate) -> DepthEstimate:
    """Fuse two independent estimates, normal in log depth; the first covers all pixels."""
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


@dataclass(frozen=True)
class Fallback:
    """Anchored map, with a note that says why it is not the learned one."""

    anchored: DepthSolver
    why: str

    def __call__(self, view: View) -> DepthEstimate:
        """Anchored map, or one without any depth."""
        note = f"not learned: {self.why}"
        result = self.anchored(view)
        if result is None:
            return DepthEstimate(np.full(view.image.shape, np.nan), note=f"no depth; {note}")
        return replace(result, note=f"anchored on the spots, {note}")

    def frame_map(self, view: View) -> FrameMap | None:
        """The same; None without spots."""
        return None if view.ranges is None else FrameMap(self(view))


@lru_cache(maxsize=1)
def shipped() -> DepthNetwork:
    """Network of this package."""
    return load(WEIGHTS)


METHOD = Learned()
