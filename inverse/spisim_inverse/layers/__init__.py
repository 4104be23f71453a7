"""Readings that a network, or patterns, can be trained through: values and gradients.

`readings`, `scene` and `display` define each function and its vector-Jacobian product once, for
arrays of any library. `for_torch` and `for_jax` wrap them; import the one whose library you have.
"""

from spisim_inverse.layers.readings import ReadingModel
from spisim_inverse.layers.scene import SceneImage

__all__ = ["ReadingModel", "SceneImage"]
