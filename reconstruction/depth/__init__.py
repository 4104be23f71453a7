"""From image, ranges and readings to depth maps: methods, rays, point clouds."""

from .method import REACH_M, Context, DepthEstimate, DepthMethod, DepthSolver, View
from .methods import DEPTH_METHODS, depth_method, lacks, unlike
from .obstacle import Corridor
from .pointcloud import point_cloud_ply
from .rays import pixel_of, pixel_rays, range_over_depth

__all__ = [
    "DEPTH_METHODS",
    "REACH_M",
    "Context",
    "Corridor",
    "DepthEstimate",
    "DepthMethod",
    "DepthSolver",
    "View",
    "depth_method",
    "lacks",
    "pixel_of",
    "pixel_rays",
    "point_cloud_ply",
    "range_over_depth",
    "unlike",
]
