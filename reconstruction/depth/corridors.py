"""Free corridors of the frames of a recording."""

from collections.abc import Mapping

from ..capture import Setup
from ..ranging.brightness import Brightness
from ..ranging.first_surface import first_surfaces
from ..ranging.image_level import ImageLevel
from ..ranging.reach import blind_below_m, reach_m
from .ahead import corridors_of
from .corridor_posterior import CorridorPosterior, SpotsAhead
from .method import DepthEstimate, FreeTowards, View, unknown_depth
from .pixels import pixel_of, pixel_rays


class Corridors:
    """Free corridors by all that a frame does not exclude; of its maps alone without spots."""

    def __init__(self, setup: Setup) -> None:
        self._optics, self._shape = setup.optics, setup.plan.shape
        self._rays = None if setup.optics is None else pixel_rays(setup.optics, self._shape)
        spots = setup.spots
        self._reach = None if spots is None else (blind_below_m(spots), reach_m(spots))
        self._level = None if spots is None else ImageLevel.of(setup.optics, spots)

    def __call__(
        self,
        maps: Mapping[str, DepthEstimate],
        view: View,
        brightness: Brightness | None,
        default: str | None,
    ) -> dict[str, FreeTowards]:
        """Corridors of each map; without any, those of ``default``: something may be in the way.

        Parameters
        ----------
        maps
            Of a frame, by method.
        view
            What the frame shows.
        brightness
            Of the image at the spots, if known.
        default
            The default method, if there is one.
        """
        if not maps and view.ranges is not None and default is not None:
            maps = {default: unknown_depth(self._shape)}
        of_maps = {name: corridors_of(each, self._rays) for name, each in maps.items()}
        spots = self._spots_ahead(view, brightness)
        if spots is None or self._rays is None:
            return {name: each for name, each in of_maps.items() if each is not None}
        return {
            name: CorridorPosterior(each, of_maps[name], spots, self._rays)
            for name, each in maps.items()
        }

    def _spots_ahead(self, view: View, brightness: Brightness | None) -> SpotsAhead | None:
        """What the spots leave open of what is ahead; None without them, or without optics."""
        if view.ranges is None or self._reach is None or self._optics is None:
            return None
        level = None
        if brightness is not None and self._level is not None:
            level = self._level.likelihood(brightness)
        surfaces = first_surfaces(view.ranges, *self._reach, level)
        pixel = pixel_of(view.directions, self._optics, self._shape)
        return SpotsAhead(surfaces, view.directions, pixel, view.image)
