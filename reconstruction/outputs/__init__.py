"""What a reconstruction leaves behind: the result as a file, pictures, a point cloud."""

from .folder import write_outputs
from .result_file import read_result

__all__ = ["read_result", "write_outputs"]
