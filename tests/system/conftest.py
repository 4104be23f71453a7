"""Fixtures that several system tests share."""

from pathlib import Path

import pytest

from reconstruction import Capture, write_capture


@pytest.fixture
def capture_file(capture: Capture, tmp_path: Path) -> Path:
    """A capture of a slanted wall, on disk."""
    path = tmp_path / "capture.h5"
    write_capture(capture, path)
    return path
