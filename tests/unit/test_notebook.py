"""What objects show of themselves in notebooks, and what Tab finds."""

from html.parser import HTMLParser
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

import reconstruction
import spisim
from datasets import make_set
from reconstruction import Capture, notebook, reconstruct
from spisim.dataset import open as open_data_set


def checked(html: str, *words: str) -> str:
    """HTML whose elements are all closed, with these words in it."""
    fromstring(html.replace("<img ", "<img/><!-- ").replace('pixelated">', 'pixelated" -->'))
    HTMLParser().feed(html)
    for word in words:
        assert word in html
    return html


def test_a_capture_shows_its_readings_and_its_truth(capture: Capture) -> None:
    html = checked(capture._repr_html_(), "Capture", "128 of 16 × 16 pixels", "true image")
    assert html.count("<figure") == 2


def test_a_result_shows_image_depth_and_ranges(capture: Capture) -> None:
    result = reconstruct(capture, image="zero-filled", depth="nearest")
    html = checked(result._repr_html_(), "image, zero-filled", "depth, nearest", "4.200 ± ")
    assert html.count("<figure") == 2


def test_a_scene_and_an_instrument_show_themselves() -> None:
    checked(spisim.load_scene("target-plane")._repr_html_(), "from above", "clear")
    checked(spisim.load_instrument("paper")._repr_html_(), "1550 nm", "cw", "spots in red")


def test_a_data_set_shows_its_first_samples(capture: Capture, tmp_path: Path) -> None:
    make_set(tmp_path / "set", capture, done=4, failed=1)
    html = checked(open_data_set(tmp_path / "set")._repr_html_(), "4 done, 1 failed", "sample 2")
    assert html.count("<figure") == 3


@pytest.mark.parametrize("values", [np.full((2, 2), np.nan), np.zeros((2, 2)), [[1, np.nan]]])
def test_maps_of_nothing_and_of_one_value_are_shown(values: np.ndarray) -> None:
    checked(notebook.picture(values, "a <map>", "m"), "a &lt;map&gt;")


@pytest.mark.parametrize("package", [spisim, reconstruction])
def test_tab_lists_the_public_names(package: object) -> None:
    assert dir(package) == sorted(package.__all__)  # type: ignore[attr-defined]
    assert "__version__" in dir(spisim)
