"""Performance of an instrument in closed form: light, noise, range, eye safety.

For a flat Lambertian target across the optical axis that fills the field. `spisim.transport` and
`spisim.simulation` compute the same for any scene, and agree where both apply.
"""

from spisim.budget.diagnostics import background_warnings, budget_warnings, instrument_warnings
from spisim.budget.eye_safety import array_risk_group, class_1_power_w, laser_safety
from spisim.budget.fog import FogBudget, fog_budget
from spisim.budget.image import ImageBudget, image_budget
from spisim.budget.link import Target, bucket_link, spot_link
from spisim.budget.noise import (
    bucket_noise,
    collected_fraction,
    exposure_noise,
    ranging_noise,
    spot_noise,
)
from spisim.budget.ranging import longest_range_m, range_sigma_m

__all__ = [
    "FogBudget",
    "ImageBudget",
    "Target",
    "array_risk_group",
    "background_warnings",
    "bucket_link",
    "bucket_noise",
    "budget_warnings",
    "class_1_power_w",
    "collected_fraction",
    "exposure_noise",
    "fog_budget",
    "image_budget",
    "instrument_warnings",
    "laser_safety",
    "longest_range_m",
    "range_sigma_m",
    "ranging_noise",
    "spot_link",
    "spot_noise",
]
