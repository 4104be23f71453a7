"""Pages as a browser renders them: nothing overlaps or is cut off, all can be read and moved."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import spisim.dataset
from browser import Browser, chromium
from datasets import make_set
from designs import finished
from reconstruction import Capture, evaluate, reconstruct
from spisim.dataset.records import Record
from spisim.dataset.study.evaluation import Evaluation
from spisim.dataset.study.results import results_of
from spisim_app.report.capture import write_report
from spisim_app.report.contact_sheet import write_contact_sheet
from spisim_app.report.flight import EvaluatedFrame
from spisim_app.report.flight_page import write_flight
from spisim_app.report.study import write_study
from spisim_compare.comparing import compare
from spisim_compare.page import write_comparison
from spisim_inverse.design.page import write_design
from studies import planned

RENDERED = (Path(__file__).parents[1] / "rendered.js").read_text(encoding="utf-8")
DESKTOP, PHONE = 1280, 390
PAGES = ("report", "sheet", "study", "flight", "comparison", "design")
METRICS = ["range_bias_m", "depth_mae_m", "depth_mae_m[nearest]"]

pytestmark = pytest.mark.skipif(chromium() is None, reason="there is no Chromium")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    program = chromium()
    assert program is not None
    with Browser(program) as window:
        yield window


@pytest.fixture(scope="module")
def folder(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One page of each kind."""
    folder = tmp_path_factory.mktemp("pages")
    _report(folder / "report.html", capture)
    samples = make_set(folder / "set", capture, done=3, failed=0)
    write_contact_sheet(folder / "sheet.html", spisim.dataset.open(samples))
    (folder / "study").mkdir()
    _study(folder / "study")
    (folder / "study" / "report.html").rename(folder / "study.html")
    _flight(folder / "flight.html", capture)
    _comparison(folder / "comparison.html", capture)
    write_design(folder / "design.html", finished(folder))
    return folder


def _report(path: Path, capture: Capture) -> None:
    """With everything that a report may show: tiny light, two plots of it, all methods."""
    result = reconstruct(capture, depth="all")
    assert capture.truth is not None
    histogram = np.full((4, 600), 1e-9)
    histogram[:, 400:430] = 1e-6
    write_report(
        path,
        capture,
        result,
        metrics=evaluate(result, capture),
        transport=SimpleNamespace(spot_histogram=histogram, path_length_m=0.02 * np.arange(600)),
        view=3e-13 * np.kron(capture.truth.image[0], np.ones((2, 2))),
        timings={"simulate": 12.5},
        title="A wall in fog, seen on one of those autumn mornings",
    )


def _study(folder: Path) -> None:
    names = ["a warehouse that has a rather long name", "clear"]
    study = planned(
        folder,
        {"x": "scene.description", "metrics": METRICS},
        vary={"scene.description": {"grid": names}},
    )
    records = [
        Record(
            index,
            "done",
            scene="wall",
            parameters={"scene": "wall", "scene.description": names[index % 2]},
        )
        for index in range(4)
    ]
    evaluations = {
        index: Evaluation(dict.fromkeys(METRICS, 0.004 + 0.001 * index)) for index in range(4)
    }
    write_study(folder, results_of(study, records, evaluations))


def _flight(path: Path, capture: Capture) -> None:
    result = reconstruct(capture)
    flight = []
    for number in range(3):
        pose = np.eye(4)
        pose[:3] = [[1, 0, 0, 0.3 * number], [0, 0, 1, 0], [0, -1, 0, 1]]
        at = f"capture-{number:04}.h5", 0.5 * number, pose
        flight.append(EvaluatedFrame(*at, capture, result, evaluate(result, capture)))
    write_flight(path, "wall", flight, 2.0)


def _comparison(path: Path, capture: Capture) -> None:
    brighter = replace(capture.buckets, counts=1.3 * capture.buckets.counts)
    comparison = compare(replace(capture, buckets=brighter), capture)
    write_comparison(path, "comparison", "a rig and its simulation", comparison)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width_px", [DESKTOP, PHONE])
@pytest.mark.parametrize("page", PAGES)
def test_a_page_can_be_read(
    browser: Browser, folder: Path, page: str, width_px: int, dark: bool
) -> None:
    browser.open(folder / f"{page}.html", width_px, dark=dark)
    assert browser.run(RENDERED) == []
    assert browser.said == []
    dark_paper = browser.run("getComputedStyle(document.body).backgroundColor") < "rgb(2"
    assert dark_paper == dark
    displayed = browser.run("[...document.images].every((image) => image.naturalWidth > 0)")
    assert displayed


def test_what_is_wrong_with_a_page_is_found(browser: Browser, tmp_path: Path) -> None:
    page = tmp_path / "bad.html"
    page.write_text(
        "<!doctype html><p style='color:#aaa'>pale</p>"
        "<p style='margin:-2.2em 0 0'>another line of words</p>"
        "<p style='width:2000px;text-align:right'>far away</p>"
    )
    browser.open(page, PHONE)
    result = "\n".join(browser.run(RENDERED))
    assert 'of "pale"' in result
    assert 'cut off at the side: "far away"' in result
    assert "scrolls sideways" in result
    assert '"another line of words" overlaps "pale"' in result


def test_pictures_are_large_and_stay_pixels(browser: Browser, folder: Path) -> None:
    for width_px, min_px in ((DESKTOP, 240), (PHONE, 150)):
        browser.open(folder / "report.html", width_px)
        sizes, looks = browser.run(
            "(() => { const all = [...document.querySelectorAll('[data-kind] img')];"
            "return [all.map((each) => each.clientWidth),"
            "all.map((each) => getComputedStyle(each).imageRendering)]; })()"
        )
        assert min(sizes) >= min_px
        assert set(looks) == {"pixelated"}


def test_values_are_read_below_the_pointer(browser: Browser, folder: Path) -> None:
    browser.open(folder / "report.html", DESKTOP)
    x, y = _middle(browser, "[data-kind=depth][data-method=true] .frame")
    browser.mouse("mouseMoved", x, y)
    reported = browser.run(
        "[...document.querySelectorAll('[data-kind=depth] output')].map((each) => each.innerText)"
    )
    assert reported[0] == "4.50 m"  # column 8 of 16 on the slanted wall
    assert all(words.endswith("m") for words in reported)


def test_the_map_tells_all_of_a_pixel_and_the_cloud_turns(browser: Browser, folder: Path) -> None:
    browser.open(folder / "report.html", DESKTOP)
    x, y = _middle(browser, ".large .frame")
    browser.mouse("mouseMoved", x, y)
    reported = browser.run(
        "Object.fromEntries([...document.querySelectorAll('.pixel div')].map((each) =>"
        "[...each.children].map((child) => child.textContent)))"
    )
    assert reported["Pixel"] == "8, 8"
    assert reported["True range"] == "4.50 m"
    assert {"Range", "Error"} <= reported.keys()
    clouds = [_cloud(browser)]
    browser.run("document.querySelector('[name=truth]').click()")
    clouds.append(_cloud(browser))
    x, y = _middle(browser, "canvas")
    browser.mouse("mousePressed", x, y, button="left", clickCount=1)
    browser.mouse("mouseMoved", x + 60, y + 20, button="left")
    browser.mouse("mouseReleased", x + 60, y + 20, button="left")
    clouds.append(_cloud(browser))
    assert len(set(clouds)) == 3


def test_sliders_show_what_comes_one_after_the_other(browser: Browser, folder: Path) -> None:
    for page, part, first in (
        ("report", ".buildup", "4 patterns · 1.56 % · 533 µs"),
        ("flight", ".flight-player", "0.00 s · mean depth error"),
    ):
        browser.open(folder / f"{page}.html", PHONE)
        reported = browser.run(
            f"(() => {{ const part = document.querySelector('{part}');"
            "const slider = part.querySelector('input[type=range]'); slider.value = 0;"
            "slider.dispatchEvent(new Event('input'));"
            "return part.querySelector('.step output').textContent; })()"
        )
        assert reported.startswith(first)


def _middle(browser: Browser, selector: str) -> tuple[float, float]:
    """Just right of and below the middle of an element, after scrolling to it."""
    x, y = browser.run(
        f"(() => {{ const found = document.querySelector('{selector}');"
        "found.scrollIntoView({block: 'center'}); const box = found.getBoundingClientRect();"
        "return [box.left + 0.51 * box.width, box.top + 0.51 * box.height]; })()"
    )
    return x, y


def _cloud(browser: Browser) -> str:
    """The picture of the cloud, once it is drawn."""
    picture: str = browser.run(
        "new Promise((done) => setTimeout(() => requestAnimationFrame(() =>"
        "done(document.querySelector('canvas').toDataURL())), 50))"
    )
    return picture
