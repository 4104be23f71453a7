"""From four ranges and an image to a depth map."""

from .anchored import anchored_depth, nearest_range
from .pointcloud import point_cloud_ply
from .rays import pixel_of, pixel_rays

__all__ = ["anchored_depth", "nearest_range", "pixel_of", "pixel_rays", "point_cloud_ply"]
