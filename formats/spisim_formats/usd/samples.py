"""Values of OpenUSD that exist at times alone: the earliest of them becomes the default."""

from typing import Any

from spisim_formats.library.content import Content
from spisim_formats.library.files import quoted


def settle(layer: Any, content: Content) -> None:
    """Give attributes of a layer that have time samples alone the earliest as default, in memory.

    The others are erased there; a note counts the attributes.
    """
    from pxr import Sdf

    sampled: list[Any] = []

    def collect(path: Any) -> None:
        if path.IsPropertyPath() and layer.GetNumTimeSamplesForPath(path):
            sampled.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, collect)
    settled = []
    for path in sampled:
        attribute = layer.GetAttributeAtPath(path)
        if attribute is None or attribute.HasDefaultValue():
            continue
        times = layer.ListTimeSamplesForPath(path)
        earliest = min(times)
        attribute.default = layer.QueryTimeSample(path, earliest)
        for time in times:
            layer.EraseTimeSample(path, time)
        settled.append((path, earliest))
    if settled:
        path, time = settled[0]
        content.note(
            f"{layer.GetDisplayName()}: values that change in time without a default are as at "
            f"their earliest time: {len(settled)}, first {quoted(str(path))} at {time:g}"
        )
