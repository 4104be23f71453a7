"""What the anchored depth map takes for granted of scenes, fitted by `tools/anchored_prior.py`."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

FITTED = Path(__file__).with_suffix(".json")


@dataclass(frozen=True)
class AnchoredPrior:
    """Constants of `reconstruction.depth.kriging`.

    ``log_depth_sigma``: spread of ln depth within a view as far as known beforehand, which
    counts as one anchor. ``log_reflectance_sigma``: spread of ln(rho cos theta).
    ``correlation_length``: in the image, relative to its longer side; ``similarity``: difference of
    ln I beyond which two pixels tell little of each other. ``nugget``: share of the variance that a
    pixel has to itself, whatever is around it. ``min_brightness``: pixels are taken to be at least
    this bright, relative to the 90th percentile. ``uncertain``: ranges of a larger relative
    deviation do not bound the map where they are. ``max_nearer``: the map goes nearer than the
    nearest anchor by this factor at most, and not beyond the farthest: what is bright must be near,
    what is dark may just be dark. ``sigma_factor``: factor of the deviation told over that of the model.
    """

    log_depth_sigma: float
    log_reflectance_sigma: float
    correlation_length: float
    similarity: float
    nugget: float
    min_brightness: float
    uncertain: float
    max_nearer: float
    sigma_factor: float


@cache
def fitted_prior() -> AnchoredPrior:
    """The constants that are fitted to drawn scenes."""
    return AnchoredPrior(**json.loads(FITTED.read_text())["prior"])
