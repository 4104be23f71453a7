"""From Walsh-Hadamard coefficients to an image."""

from .linear import zero_filled
from .omp import batch_omp
from .weighted import WeightedPursuit, pursuit_for

__all__ = ["WeightedPursuit", "batch_omp", "pursuit_for", "zero_filled"]
