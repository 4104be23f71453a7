"""Methods by stage, and texts for plots and tables."""

from collections.abc import Callable, Iterable, Mapping

from ..base.errors import InputError
from ..depth import DEPTH_METHODS, DepthMethod
from ..image import ImageMethod, image_method
from ..ranging import RANGING_METHODS, Alternative, RangingMethod, Status

Method = ImageMethod | RangingMethod | DepthMethod

METHODS: Mapping[str, Callable[[str], Method]] = {
    "images": image_method,
    "spots": RANGING_METHODS.__getitem__,
    "depths": DEPTH_METHODS.__getitem__,
}
"""Functions that return a method by name, by the stages of `evaluate`; InputError if unknown."""
MAX_ALTERNATIVES, MIN_WEIGHT = 3, 0.01
"""Alternative ranges that `no_range` lists at most, and the weight that each must have."""


def method_title(stage: str, name: str) -> str:
    """Label of a method of a `METHODS` stage for plots and tables; its name if not installed."""
    try:
        title = getattr(METHODS[stage](name), "title", name)
    except InputError:
        return name
    dictionary = name.partition(":")[2]
    return f"{title}, {dictionary}" if dictionary else title


def no_range(status: Status, alternatives: Iterable[Alternative]) -> str:
    """Why a spot of this status has no range, and its possible ranges, most probable first."""
    likely = [each for each in alternatives if each.weight >= MIN_WEIGHT][:MAX_ALTERNATIVES]
    if not likely:
        return status
    if len(likely) == 1:
        return f"{status}: {likely[0].range_m:.2f} ± {likely[0].sigma_m:.2f} m"
    ranges = (f"{each.range_m:.2f} m ({100 * each.weight:.0f} %)" for each in likely)
    return f"{status}: {', '.join(ranges)}"
