"""A Rerun recording, opened in the viewer or saved as a file, and its content per frame."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.base.errors import InputError
from reconstruction.base.files import Output, mark
from spisim.base.optional import import_optional
from spisim_app.report.viewer.layout import layout
from spisim_app.report.viewer.readings import draw_pictures, draw_readings, style_ranges
from spisim_app.report.viewer.space import Space
from spisim_app.report.viewer.views import View
from spisim_app.report.viewer.window import open_window

KIND = "recording of Rerun"
SUFFIX = ".rrd"


def library() -> Any:
    """Import Rerun. Raises InputError, naming what to install, if it is missing."""
    return import_optional("rerun", "viewer")


def recording_output(path: Path) -> Output:
    """Return the file of a recording, which Rerun marks with the name of the application."""
    return Output(path, KIND, (SUFFIX,))


def check_viewer() -> None:
    """Raise InputError if no window can be opened."""
    display = sys.platform == "darwin" or os.environ.get("DISPLAY") or os.environ.get(
        "WAYLAND_DISPLAY"
    )  # fmt: skip
    if not display:
        raise InputError(
            "no display for the viewer; --save FILE.rrd writes a recording, and "
            "`rerun FILE.rrd` opens it on another machine"
        )


class Recording:
    """Frames in a Rerun recording at their times, which is saved or displayed until closed.

    Raises InputError without Rerun, and if its window cannot be opened.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._rerun = rr = library()
        self._stream = rr.RecordingStream(mark(KIND))
        if path is None:
            rr.connect_grpc(open_window(), recording=self._stream)
        else:
            rr.save(path, recording=self._stream)
        self._space = Space(rr, self._stream)
        self._begun_ns: int | None = None
        self.frames = self._styled = 0

    def add(self, view: View) -> None:
        """Add a frame."""
        stream = self._stream
        if self._begun_ns is None:
            self._begun_ns = view.shot.stamp_ns
            pose = np.eye(4) if view.shot.pose is None else view.shot.pose
            self._rerun.send_blueprint(layout(pose, view.scene), recording=stream)
        seconds = (view.shot.stamp_ns - self._begun_ns) / 1e9
        stream.set_time("time", duration=np.timedelta64(round(1e9 * seconds), "ns"))
        stream.set_time("frame", sequence=self.frames)
        self.frames += 1
        count = 0 if view.shot.spots is None else len(view.shot.spots.directions)
        style_ranges(self._rerun, stream, range(self._styled, count))
        self._styled = max(self._styled, count)
        self._space.draw(view)
        draw_pictures(self._rerun, stream, view)
        draw_readings(self._rerun, stream, view)

    def close(self) -> None:
        """Write pending data, and release the file or the viewer.

        Raises InputError if the viewer was closed meanwhile.
        """
        try:
            self._stream.flush()
        except RuntimeError as error:
            raise InputError(f"the viewer did not take all frames: {error}") from None
        finally:
            self._stream.disconnect()
