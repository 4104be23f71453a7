"""Window of a live stream, which reads results from its standard input."""

import os
import select
import sys
import time
from typing import Any

import numpy as np

from reconstruction.ranging import RANGED

from .framing import Kind, Parser
from .results import STATUSES, text_of
from .sinks.window import READY
from .tables import Value, unpacked

EVERY_S = 0.05
OLD_S = 0.5
"""Age from which on a result is faded."""
ASKED = "use --to FOLDER, or --to tcp-listen://:5801 and look from another machine"


def main() -> int:
    """Draw results until they end or the window is closed."""
    try:
        import matplotlib as mpl
    except ModuleNotFoundError:
        print(
            f"Matplotlib is missing: pip install './reconstruction[window]', or {ASKED}", flush=True
        )
        return 2
    if mpl.get_backend().lower() == "agg":
        print(f"there is no display; {ASKED}", flush=True)
        return 2
    try:
        from matplotlib import pyplot as plt

        window = Window(plt.figure("reconstruction live", figsize=(10, 5)))
        plt.show(block=False)
    except Exception as error:  # whatever a toolkit raises without a display
        print(f"{' '.join(str(error).split()) or type(error).__name__}; {ASKED}", flush=True)
        return 2
    print(READY, flush=True)
    source = Incoming()
    while plt.fignum_exists(window.figure.number) and not source.over:
        source.look(EVERY_S)
        window.show(source)
        window.figure.canvas.draw_idle()
        window.figure.canvas.flush_events()
    return 0


class Incoming:
    """The latest result and state received."""

    def __init__(self, descriptor: int = 0) -> None:
        self.result: dict[str, Value] = {}
        self.state: dict[str, Value] = {}
        self.frame = 0
        self.over = False
        self._came_s = float("nan")
        self._descriptor = descriptor
        self._parser = Parser()

    @property
    def age_s(self) -> float:
        """Seconds since the latest result."""
        return time.monotonic() - self._came_s

    def look(self, timeout_s: float) -> None:
        """Take available bytes, waiting up to ``timeout_s``."""
        while not self.over and select.select([self._descriptor], [], [], timeout_s)[0]:
            content = os.read(self._descriptor, 2**16)
            self.over = not content
            self.take(content)
            timeout_s = 0.0

    def take(self, content: bytes) -> None:
        """Take bytes."""
        for message in self._parser.feed(content):
            if message.payload is not None and message.kind == Kind.RESULT:
                self.result, self.frame = unpacked(message.payload), message.number
                self._came_s = time.monotonic()
            elif message.payload is not None and message.kind == Kind.STATUS:
                self.state = unpacked(message.payload)


class Window:
    """Image and depth map side by side, with ranges and state of the stream."""

    def __init__(self, figure: Any) -> None:
        self.figure = figure
        self._maps: dict[str, Any] = {}
        axes = figure.subplots(1, 2)
        self._axes = dict(zip(("image", "depth_m"), axes, strict=True))
        for axis, title in zip(axes, ("image", "depth / m"), strict=True):
            axis.set_title(title)
            axis.set_axis_off()
        self._text = figure.text(0.02, 0.02, "waiting for a frame", family="monospace")

    def show(self, source: Incoming) -> None:
        """Draw the latest result and its age."""
        for name, axis in self._axes.items():
            if name in source.result:
                self._draw(name, axis, source.result[name])
        old = source.age_s > OLD_S
        for artist in self._maps.values():
            artist.set_alpha(0.4 if old else 1.0)
        self._text.set_color("crimson" if old else "black")
        self._text.set_text("\n".join(status_lines(source)))

    def _draw(self, name: str, axis: Any, values: Value) -> None:
        finite = values[np.isfinite(values)]
        low, high = np.percentile(finite, (1, 99)) if finite.size else (0.0, 1.0)
        if name not in self._maps or self._maps[name].get_array().shape != values.shape:
            axis.clear()
            axis.set_axis_off()
            axis.set_title({"image": "image", "depth_m": "depth / m"}[name])
            colours = {"image": "gray", "depth_m": "viridis"}[name]
            self._maps[name] = axis.imshow(values, cmap=colours)
            if name == "depth_m":
                self.figure.colorbar(self._maps[name], ax=axis)
        self._maps[name].set_data(values)
        self._maps[name].set_clim(low, max(high, low + 1e-9))


def status_lines(source: Incoming) -> list[str]:
    """Lines of text: ranges, age, counts."""
    lines = []
    if "range_m" in source.result:
        ranges = zip(
            source.result["range_m"],
            source.result["range_sigma_m"],
            source.result["range_status"],
            strict=True,
        )
        lines.append(
            "ranges  "
            + "   ".join(
                f"{range_m:.3f} +- {sigma_m:.3f} m"
                if STATUSES[status] in RANGED
                else STATUSES[status]
                for range_m, sigma_m, status in ranges
            )
        )
    if source.result:
        lines.append(f"frame {source.frame}, {source.age_s:.1f} s old")
    if source.state:
        names = ("frames_per_s", "lost", "late", "corrupted", "dropped")
        lines.append(", ".join(f"{name} {float(source.state[name]):g}" for name in names))
        lines += [trouble] if (trouble := text_of(source.state["trouble"])) else []
    return lines


if __name__ == "__main__":
    sys.exit(main())
