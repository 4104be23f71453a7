"""The result of one frame."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .base.arrays import Floats
from .base.display import draw_map, html_summary, panels, picture, text_summary
from .base.errors import InputError
from .capture import Setup, Unit
from .depth import MIN_FREE, FreeTowards, nearest_obstacle_m
from .ranging import RANGED, Ranges, Visibility

Image = NDArray[np.float32]

BASELINE = "zero-filled"
"""Image method in every result, to compare the others with."""


@dataclass(frozen=True, eq=False)
class Result:
    """Image, ranges and depth of one frame by one or several methods, the default one first.

    Attributes
    ----------
    images, sigmas
        By method, what each virtual pixel contributes to an exposure (H, W), in ``unit``, and its
        standard deviation, for methods that state one.
    rangings
        Ranges of the spots by method; empty without time of flight.
    depths, log_depth_sigmas
        Depth along the optical axis (H, W) in metres by method, nan where there is none, and the
        standard deviation of ln depth, for methods that state one.
    no_returns
        Probability (H, W) of no return within the maximum range, by method (see `DepthEstimate`).
    free_probabilities, min_free
        Probability (K,) that the corridor ahead is free up to each of
        `reconstruction.depth.DISTANCES_M`, by method; an obstacle is where it falls below
        ``min_free``.
    range_over_depth
        Length of each pixel's ray per unit of depth (H, W), None if the optics are unknown.
    spot_directions
        Unit vectors (spots, 3) of the ranges in this frame; None without time of flight.
    points_m
        Points (N, 3) in the optical frame that earlier ranges have met, for depth methods that
        remember them.
    corridors
        By method, the same as ``free_probabilities`` as a function of a direction; see
        `free_towards`. Files do not hold them.
    unit
        Unit of the images; counts if their scale is unknown.
    timings_s, notes
        Seconds, and what the user must know, by stage: "depth anchored" or "ranging cw".
    recording, frame, patterns
        Digest of the readings, their frame's index in the capture, and the number of distinct
        patterns behind the images.
    """

    images: Mapping[str, Image]
    sigmas: Mapping[str, Image]
    rangings: Mapping[str, Ranges]
    depths: Mapping[str, Image]
    range_over_depth: Image | None
    timings_s: Mapping[str, float]
    unit: Unit
    recording: str
    frame: int
    patterns: int
    log_depth_sigmas: Mapping[str, Image] = field(default_factory=dict)
    no_returns: Mapping[str, Image] = field(default_factory=dict)
    free_probabilities: Mapping[str, Floats] = field(default_factory=dict)
    min_free: float = MIN_FREE
    notes: Mapping[str, str] = field(default_factory=dict)
    spot_directions: Floats | None = None
    points_m: Mapping[str, Floats] = field(default_factory=dict)
    corridors: Mapping[str, FreeTowards] = field(default_factory=dict)

    @property
    def warnings(self) -> list[str]:
        """The notes as sentences."""
        stages = ((*stage.partition(" "), note) for stage, note in self.notes.items())
        return [f"{station} {name!r} is {note}" for station, _, name, note in stages]

    def aimed(self, setup: Setup) -> Setup:
        """The setup of the recording, with the spots' directions of this frame."""
        if setup.spots is None or setup.spots.pointing is None or self.spot_directions is None:
            return setup
        return replace(setup, spots=replace(setup.spots, directions=self.spot_directions))

    def _repr_html_(self) -> str:
        pictures = [picture(self.image, f"image, {next(iter(self.images))}", f"{self.unit}s")]
        if self.depth_m is not None:
            pictures.append(picture(self.depth_m, f"depth, {next(iter(self.depths))}", "m"))
        return html_summary("Result", self._facts, pictures)

    def __repr__(self) -> str:
        return text_summary("Result", self._facts)

    @property
    def _facts(self) -> dict[str, Any]:
        facts: dict[str, Any] = {
            "frame": self.frame,
            "patterns": self.patterns,
            "images": ", ".join(self.images),
            "depths": ", ".join(self.depths) or "none",
        }
        if self.ranges is not None:
            rows = zip(self.ranges.status, self.ranges.range_m, self.ranges.sigma_m, strict=True)
            for spot, (status, range_m, sigma_m) in enumerate(rows):
                given = f"{range_m:.3f} ± {sigma_m:.2g} m"
                given += "" if status == "ok" else f" ({status})"
                facts[f"spot {spot}"] = given if status in RANGED else status
        if self.visibility is not None:
            facts["visibility"] = str(self.visibility)
        return facts | {f"note {number}": each for number, each in enumerate(self.warnings, 1)}

    def plot(self) -> Any:
        """Draw image, depth map, and ranges with their sigma.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, (panels,)

        Raises
        ------
        InputError
            If Matplotlib is not installed.
        """
        depth_m, ranges = self.depth_m, self.ranges
        image, *others = axes = panels(1 + (depth_m is not None) + (ranges is not None))
        draw_map(image, self.image, f"image, {next(iter(self.images))}", f"{self.unit}s")
        if depth_m is not None:
            draw_map(others.pop(0), depth_m, f"depth, {next(iter(self.depths))}", "m", "viridis_r")
        if ranges is not None:
            spots = np.arange(len(ranges.status))
            others[0].errorbar(spots, ranges.range_m, ranges.sigma_m, fmt="o", capsize=4)
            others[0].set(title=f"ranges, {next(iter(self.rangings))}", ylabel="m")
            others[0].set_xticks(spots, [f"spot {spot}" for spot in spots])
            others[0].set_xlim(-0.5, len(spots) - 0.5)
        return axes

    @property
    def image(self) -> Image:
        """Image by the default method."""
        return next(iter(self.images.values()))

    @property
    def sigma(self) -> Image | None:
        """Standard deviation of the image's pixels, None if the default method states none."""
        return self.sigmas.get(next(iter(self.images)))

    @property
    def ranges(self) -> Ranges | None:
        """Ranges of the spots by the default method, None without time of flight."""
        return next(iter(self.rangings.values()), None)

    @property
    def visibility(self) -> Visibility | None:
        """Visibility by the first ranging method that states it, None if none does."""
        stated = (ranges.visibility for ranges in self.rangings.values())
        return next((each for each in stated if each is not None), None)

    @property
    def depth_m(self) -> Image | None:
        """Depth along the optical axis by the default method, None if there is none."""
        return next(iter(self.depths.values()), None)

    @property
    def log_depth_sigma(self) -> Image | None:
        """Standard deviation of ln depth, None if the default method states none."""
        return self.log_depth_sigmas.get(next(iter(self.depths), ""))

    @property
    def no_return(self) -> Image | None:
        """Probability of no return, None if the default method states none."""
        return self.no_returns.get(next(iter(self.depths), ""))

    @property
    def free_probability(self) -> Floats | None:
        """Probability of a free corridor up to each of `DISTANCES_M` (K,), None if unknown.

        Known without any depth, too, where there are spots.
        """
        return self.free_probabilities.get(next(iter(self.free_probabilities), ""))

    def free_towards(self, direction: ArrayLike) -> Floats:
        """Probability that a corridor in another direction is free, by the default method.

        Parameters
        ----------
        direction
            Of the corridor, (3,) of any length, in view: x right, y down, z forward.

        Returns
        -------
        ndarray
            Probability (K,) up to each of `DISTANCES_M`, along the direction.

        Raises
        ------
        InputError
            If it leads out of view, or the result has no depths or is from a file.
        """
        towards = self.corridors.get(next(iter(self.corridors), ""))
        if towards is None:
            raise InputError("the result has no corridors: it has no depths, or is from a file")
        return towards(direction)

    @property
    def obstacles_m(self) -> dict[str, float]:
        """Distance of the nearest obstacle by method, nan if there is none."""
        return {
            name: nearest_obstacle_m(free, self.min_free)
            for name, free in self.free_probabilities.items()
        }

    @property
    def obstacle_m(self) -> float | None:
        """Distance of the nearest obstacle by the default method, None if unknown."""
        return self.obstacles_m.get(next(iter(self.free_probabilities), ""))

    @property
    def range_m(self) -> Image | None:
        """Depth along each pixel's ray instead, None without depths or optics."""
        if self.depth_m is None or self.range_over_depth is None:
            return None
        return self.depth_m * self.range_over_depth
