"""What objects show of themselves in notebooks, and what Tab finds."""

import logging
import sys
from dataclasses import replace
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree.ElementTree import fromstring

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure

import reconstruction
import spisim
from datasets import make_set
from reconstruction import Capture, InputError, reconstruct
from reconstruction.base import display
from reconstruction.base.display import draw_map
from spisim.dataset import open as open_data_set

mpl.use("agg")


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


def test_a_few_lines_tell_what_an_object_is(capture: Capture, tmp_path: Path) -> None:
    """Not the arrays in it, which are pages."""
    make_set(tmp_path / "set", capture, done=4, failed=1)
    for thing, words in (
        (capture, ["Capture", "frames: 1", "128 of 16 × 16 pixels", "4 taps"]),
        (capture.setup, ["Setup", "128 of 16 × 16 pixels"]),
        (capture.frame(), ["Frames", "exposures: 256"]),
        (reconstruct(capture), ["Result", "images: edge-preserving, ", "spot 3: "]),
        (spisim.load_scene("target-plane"), ["Scene target-plane", "clear"]),
        (spisim.load_instrument("paper"), ["Instrument", "1550 nm"]),
        (open_data_set(tmp_path / "set"), ["Data set", "4 done, 1 failed"]),
    ):
        text = repr(thing)
        lines = text.splitlines()
        assert len(lines) <= 10, text
        assert max(map(len, lines)) <= 100, text
        for word in words:
            assert word in text
        assert str(thing) == text


def test_what_is_too_much_to_tell_is_cut() -> None:
    text = display.text_summary("Result", {f"note {n}": "a\nb" * 99 for n in range(20)})
    lines = text.splitlines()
    assert len(lines) == 10
    assert lines[-1] == "  and 12 more"
    assert lines[1].startswith("  note 0: a ba b")
    assert {len(line) for line in lines[1:-1]} == {100}


@pytest.mark.parametrize("values", [np.full((2, 2), np.nan), np.zeros((2, 2)), [[1, np.nan]]])
def test_maps_of_nothing_and_of_one_value_are_shown(values: np.ndarray) -> None:
    checked(display.picture(values, "a <map>", "m"), "a &lt;map&gt;")


@pytest.mark.parametrize("package", [spisim, reconstruction])
def test_tab_lists_the_public_names(package: object) -> None:
    assert dir(package) == sorted(package.__all__)  # type: ignore[attr-defined]
    assert "__version__" in dir(spisim)


def test_plots_have_a_panel_for_everything_that_is_known(capture: Capture) -> None:
    titles = [axes.get_title() for axes in capture.plot()]
    assert titles == ["readings of frame 0", "true image", "true depth"]
    assert len(replace(capture, truth=None).plot()) == 1
    result = reconstruct(capture, image="zero-filled", depth="nearest")
    titles = [axes.get_title() for axes in result.plot()]
    assert titles == ["image, zero-filled", "depth, nearest", "ranges, cw"]
    assert len(replace(result, rangings={}, depths={}).plot()) == 1
    assert spisim.load_scene("target-plane").plot()[1].get_ylabel() == "z, m"
    pyplot.close("all")


def test_plots_without_matplotlib_say_what_to_install(
    capture: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(InputError, match="plots need Matplotlib: pip install"):
        capture.plot()
    with pytest.raises(InputError, match="frame 7"):
        capture.plot(7)


def test_a_bar_moves_below_the_cell_of_a_notebook(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []

    class Handle:
        def update(self, page: Any) -> None:
            drawn.append(page)

    def display(page: Any, display_id: bool) -> Handle:
        drawn.append(page)
        return Handle()

    shell = SimpleNamespace(kernel=object())
    displayed = SimpleNamespace(HTML=str, display=display)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", displayed)
    with spisim.progress_bar("a <b>") as advance:
        advance(0.25)
    assert drawn[1] == '<progress value="0.250"></progress> a &lt;b&gt; 25%'


def test_no_bar_goes_into_files(capfd: pytest.CaptureFixture[str]) -> None:
    with spisim.progress_bar("light") as advance:
        advance(1.0)
    assert capfd.readouterr() == ("", "")


def test_packages_log_and_say_nothing_by_themselves(
    capture: Capture, caplog: pytest.LogCaptureFixture
) -> None:
    for package in ("spisim", "reconstruction", "spisim_live"):
        import_module(package)
        (handler,) = logging.getLogger(package).handlers
        assert isinstance(handler, logging.NullHandler)
    with caplog.at_level(logging.DEBUG, "reconstruction"):
        reconstruct(capture, image="zero-filled", depth="nearest")
    compiled, frame = caplog.messages
    assert compiled == "image methods: zero-filled; ranging methods: cw; depth methods: nearest"
    assert frame.startswith("frame 0, seconds: {'decoding': ")


def test_a_map_is_drawn_from_its_1st_to_its_99th_percentile():
    axes = Figure().subplots()
    draw_map(axes, np.append(np.linspace(0, 100, 101), [1e6, np.nan])[:, None], "a", "m")
    assert axes.images[0].get_clim() == pytest.approx((1.01, 99.99))
