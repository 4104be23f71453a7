"""From Walsh-Hadamard coefficients to an image."""

from .linear import zero_filled
from .omp import batch_omp
from .shared import without_shared_errors
from .weighted import WeightedPursuit, pursuit_for

__all__ = ["WeightedPursuit", "batch_omp", "pursuit_for", "without_shared_errors", "zero_filled"]
