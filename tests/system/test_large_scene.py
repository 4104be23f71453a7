"""A scene of a million triangles is loaded and simulated within bounds of time and memory."""

from pathlib import Path

import pytest
from large import in_a_process, write_scenes


@pytest.mark.slow
def test_a_million_triangles(tmp_path: Path) -> None:
    for path in write_scenes(tmp_path).values():
        result = in_a_process(path, spp=64)
        assert result.triangles > 1_000_000
        assert result.processor_s < 60  # 30 s on two cores
        assert result.peak_gb < 3
