"""Methods by the stations under which `evaluate` tells of them."""

from collections.abc import Callable, Mapping

from ..base.errors import InputError
from ..depth import DEPTH_METHODS, DepthMethod
from ..image import ImageMethod, image_method
from ..ranging import RANGING_METHODS, RangingMethod

Method = ImageMethod | RangingMethod | DepthMethod

METHODS: Mapping[str, Callable[[str], Method]] = {
    "images": image_method,
    "spots": RANGING_METHODS.__getitem__,
    "depths": DEPTH_METHODS.__getitem__,
}
"""By station what finds a method by its name; InputError if there is none."""


def method_title(station: str, name: str) -> str:
    """What plots and tables call a method: its name where it is not installed here."""
    try:
        title = getattr(METHODS[station](name), "title", name)
    except InputError:
        return name
    dictionary = name.partition(":")[2]
    return f"{title}, {dictionary}" if dictionary else title
