"""Files of a reconstruction: the result, pictures, a point cloud."""

from .folder import outputs_in, write_outputs
from .result_file import read_result

__all__ = ["outputs_in", "read_result", "write_outputs"]
