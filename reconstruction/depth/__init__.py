"""From image, ranges and readings to depth maps: methods, rays and point clouds."""

from .ahead import corridors_of
from .corridor_posterior import CorridorPosterior, SpotsAhead
from .corridors import Corridors
from .last_view import LastView
from .method import (
    MAX_RANGE_M,
    Context,
    DepthEstimate,
    DepthMethod,
    DepthSolver,
    FreeTowards,
    View,
)
from .methods import DEPTH_METHODS, depth_method, lacks, out_of_distribution, suits
from .obstacle import (
    CORRIDOR_M,
    DISTANCES_M,
    FORWARD,
    MIN_FREE,
    Corridor,
    check_min_free,
    nearest_obstacle_m,
)
from .pixels import pixel_of, pixel_rays, point_cloud_ply, range_over_depth

__all__ = [
    "CORRIDOR_M",
    "DEPTH_METHODS",
    "DISTANCES_M",
    "FORWARD",
    "MAX_RANGE_M",
    "MIN_FREE",
    "Context",
    "Corridor",
    "CorridorPosterior",
    "Corridors",
    "DepthEstimate",
    "DepthMethod",
    "DepthSolver",
    "FreeTowards",
    "LastView",
    "SpotsAhead",
    "View",
    "check_min_free",
    "corridors_of",
    "depth_method",
    "lacks",
    "nearest_obstacle_m",
    "out_of_distribution",
    "pixel_of",
    "pixel_rays",
    "point_cloud_ply",
    "range_over_depth",
    "suits",
]
