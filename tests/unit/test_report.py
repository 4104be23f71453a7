"""The report is one self-contained page, and shows only what the capture holds."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from captures import with_spots
from densescene import make_capture
from reconstruction import Capture, InputError, Result, evaluate, make_plan, reconstruct
from reconstruction.capture import Spots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.evaluation.comparison import compared_spots
from spisim_app.report.capture import write_report
from spisim_app.report.capture_plots import arrival_figure, light_figure
from spisim_app.report.overview import write_overview
from spisim_app.report.pictures import Scale, depth_scale, error_scale, spot_marks
from spisim_app.report.style import SPOT_COLOURS, file_of, plot_style, spot_looks

GEOMETRY: dict[str, Any] = {
    "directions": np.tile([0.0, 0.0, 1.0], (4, 1)),
    "detector_positions_m": np.zeros((4, 3)),
}
PULSED = PulsedSpots(
    **GEOMETRY,
    taps=np.ones((1, 4, 3)),
    saturated=np.zeros((1, 4, 3), bool),
    window_starts_s=np.array([-70e-9, 0.0, 65e-9]),
    pulse_width_s=65e-9,
    pulses=10,
    delay_offset_s=0.0,
    electrons_per_count=1.0,
    offset_counts=0.0,
    noise_electrons=1.0,
    excess_noise_factor=1.0,
)
HISTOGRAMS = HistogramSpots(
    **GEOMETRY,
    counts=np.ones((1, 4, 50)),
    saturated=np.zeros((1, 4), bool),
    bin_width_s=1e-9,
    start_s=0.0,
    pulses=1000,
    response_sigma_s=1e-9,
    delay_offset_s=0.0,
)


@pytest.fixture(scope="module")
def result(capture: Capture) -> Result:
    return reconstruct(capture)


class Page(HTMLParser):
    """Headings, addresses and the balance of tags."""

    VOID = frozenset({"meta", "img", "input"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.headings: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for key, value in attrs if key in {"src", "href"}]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "h2":
            self.headings.append(data)


def test_a_full_report_has_all_parts_and_needs_no_other_file(
    capture: Capture, result: Result, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    histogram = np.zeros((4, 600))
    histogram[:, 400:430] = 1e-6
    write_report(
        path,
        capture,
        result,
        metrics=evaluate(result, capture),
        transport=SimpleNamespace(spot_histogram=histogram, path_length_m=0.02 * np.arange(600)),
        view=np.ones((8, 8), np.float32),
        timings={"load": 0.5},
        title="a <b> & c",
    )
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    assert page.headings == [
        "Look around", "Recording", "Image", "Pattern by pattern", "Depth", "Laser spots",
        "Against truth", "Time", "Parameters",
    ]  # fmt: skip
    assert page.addresses
    assert all(address.startswith(("data:image/png;base64,", "#")) for address in page.addresses)
    assert text.count("<svg") == 4  # corridor and light, for wide and for narrow windows
    assert "://" not in text
    assert re.search(r"url\((?!#)", text) is None
    assert "a &lt;b&gt; &amp; c" in text
    assert "name: &lt;wall&gt;" in text
    assert list(tmp_path.iterdir()) == [path]


def test_a_dense_map_stands_beside_its_errors(tmp_path: Path) -> None:
    capture = make_capture()
    result = reconstruct(capture)
    metrics = evaluate(result, capture)
    text = report_of(capture, tmp_path, metrics=metrics)
    assert "Measured in every pixel" in text
    assert "Anchored on the spots" not in text
    assert "mean depth error" in text
    assert re.search("pixels with a value</td><td [^>]*>75.0 %</td></tr>", text)
    assert "continuous wave, 4 taps, 15 MHz" in text


def test_every_method_of_a_result_is_shown_by_its_title(capture: Capture, tmp_path: Path) -> None:
    result = reconstruct(capture, image=["usual", "pursuit:dct"])
    images, depths = dict(result.images), dict(result.depths)
    images["of <elsewhere>"] = depths["of <elsewhere>"] = result.image
    more = replace(result, images=images, depths=depths)
    write_report(tmp_path / "report.html", capture, more, metrics=evaluate(more, capture))
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    for name in ("Matching pursuit", "Matching pursuit, dct", "Of &lt;elsewhere&gt;"):
        assert f"<figcaption>{name}<small>correlation " in text
    assert text.count("<th>of &lt;elsewhere&gt;</th>") == 2
    assert "<figcaption>Error: of &lt;elsewhere&gt;</figcaption>" in text


def test_the_look_of_plots_is_their_own() -> None:
    light = SimpleNamespace(spot_histogram=np.ones((4, 9)), path_length_m=np.arange(9.0))

    def drawn() -> bytes:
        with plot_style():
            figure = light_figure(light, None)
            assert figure is not None
            return file_of(figure, "plot", "svg")

    usual = drawn()
    with rc_context({"font.size": 30, "axes.grid": False}):
        assert drawn() == usual


@pytest.mark.parametrize(
    ("spots", "words"),
    [
        (PULSED, "pulsed, 3 windows of 65 ns"),
        (HISTOGRAMS, "histograms, 50 bins of 1 ns"),
    ],
)
def test_the_method_of_time_of_flight_is_told(
    capture: Capture, tmp_path: Path, spots: Spots, words: str
) -> None:
    assert words in report_of(replace(capture, spots=spots), tmp_path)


def test_a_recording_without_truth_and_spots_gives_a_shorter_page(
    capture: Capture, tmp_path: Path
) -> None:
    bare = replace(capture, spots=None, optics=None, truth=None)
    write_report(tmp_path / "report.html", bare, reconstruct(bare))
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert page.headings == ["Recording", "Image", "Pattern by pattern", "Time", "Parameters"]


def test_metrics_that_do_not_exist_are_shown_as_dashes(
    capture: Capture, result: Result, tmp_path: Path
) -> None:
    no_return = dict.fromkeys(("correlation", "nrmse", "psnr_db", "gain_db"))
    spots = [dict.fromkeys(("range_m", "true_m", "error_m", "sigma_m"))] * 4
    metrics = {
        "truth": {"image_error": None},
        "images": dict.fromkeys(result.images, no_return),
        "spots": dict.fromkeys(result.rangings, spots),
        "depths": {},
    }
    write_report(tmp_path / "report.html", capture, result, metrics=metrics)
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "nan" not in re.sub(r"base64,[^\"]*", "", text)
    assert "of 0 measured spots" in text


def test_an_unwritable_report_leaves_nothing(
    capture: Capture, result: Result, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file is not a folder"):
        write_report(tmp_path / "file" / "report.html", capture, result)
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


def report_of(capture: Capture, folder: Path, **options: Any) -> str:
    write_report(folder / "report.html", capture, reconstruct(capture), **options)
    return (folder / "report.html").read_text(encoding="utf-8")


def test_warnings_stand_in_the_report(capture: Capture, tmp_path: Path) -> None:
    assert 'class="warnings"' not in report_of(capture, tmp_path)
    saturated = capture.buckets.saturated.copy()
    saturated[0, 9] = True
    bright = replace(capture, buckets=replace(capture.buckets, saturated=saturated))
    text = report_of(bright, tmp_path)
    assert "1 of 256 bucket readings (0.391 %) are marked saturated" in text


def test_a_spot_without_a_range_says_why(capture: Capture, tmp_path: Path) -> None:
    assert capture.spots is not None
    taps = capture.spots.taps.copy()
    taps[0, 1] = 2e5
    dim = replace(capture, spots=replace(capture.spots, taps=taps))
    assert '<td data-head="status">no signal</td>' in report_of(dim, tmp_path)


def test_the_report_has_settings_and_the_noise_of_the_truth(
    capture: Capture, result: Result, tmp_path: Path
) -> None:
    text = report_of(capture, tmp_path, metrics=evaluate(result, capture))
    assert ">spp: 7</pre>" in text
    assert "standard error is 1 % of its RMS" in text


def test_the_report_tells_the_weather(capture: Capture, tmp_path: Path) -> None:
    def reported(settings: str) -> str:
        provenance = replace(capture.provenance, settings=settings)
        return report_of(replace(capture, provenance=provenance), tmp_path)

    medium = {"where": "volume <bank>", "visibility_m": None, "backscatter_per_sr": 0.0477491}
    page = reported(yaml.safe_dump({"media": [medium]}))
    assert "<h2>Weather</h2>" in page
    assert ">volume &lt;bank&gt;</td>" in page
    assert ">0.04775</td>" in page
    assert ">–</td>" in page
    for settings in ("", "media: []", "media: fog", "- media", "a: b: c"):
        assert "<h2>Weather</h2>" not in reported(settings)


@pytest.mark.parametrize(("patterns", "fraction"), [(256, "100 %"), (3, "1.17 %")])
def test_the_share_of_patterns_is_a_plain_number(
    capture: Capture, tmp_path: Path, patterns: int, fraction: str
) -> None:
    plan = make_plan(capture.plan.shape, patterns)
    buckets = replace(
        capture.buckets,
        counts=np.ones((1, plan.exposures)) * np.arange(1, plan.exposures + 1),
        saturated=np.zeros((1, plan.exposures), bool),
    )
    text = report_of(replace(capture, plan=plan, buckets=buckets), tmp_path)
    assert f"<b>{fraction}</b>" in text


def test_counts_of_unknown_scale_are_no_electrons(capture: Capture, tmp_path: Path) -> None:
    unscaled = replace(capture.buckets, electrons_per_count=np.nan, noise_electrons=np.nan)
    text = report_of(replace(capture, buckets=unscaled, spots=None, truth=None), tmp_path)
    assert "<span>light per exposure, counts</span>" in text
    assert "electron" not in text.replace("electronics", "")


def test_the_overview_is_a_picture_of_four_panels(
    capture: Capture, result: Result, tmp_path: Path
) -> None:
    write_overview(tmp_path / "overview.png", capture, result, np.ones((8, 8), np.float32))
    header = (tmp_path / "overview.png").read_bytes()[:24]
    assert header.startswith(b"\x89PNG")
    width, height = np.frombuffer(header[16:24], ">u4")
    assert width > 3 * height


def test_colours_end_at_the_scale_and_unknown_pixels_are_transparent() -> None:
    rgba = Scale(1.0, 3.0, "gray", "m").rgba([[0.0, 1.0, 3.0, 9.0, np.nan]])
    assert rgba[0, :, 0].tolist()[:4] == [0, 0, 255, 255]
    assert rgba[0, :, 3].tolist() == [255, 255, 255, 255, 0]


def test_depth_scales_ignore_unknown_pixels_and_errors_are_symmetric() -> None:
    depth = depth_scale(np.array([[np.nan, 2.0, 4.0]]))
    assert 2.0 <= depth.low < depth.high <= 4.0
    error = error_scale(np.array([[-1.0, np.nan]]), np.array([[3.0]]))
    assert error.low == -error.high
    assert 1.0 < error.high <= 3.0


def test_depth_scales_of_nothing_run_from_0_to_1() -> None:
    assert depth_scale() == depth_scale([[np.nan]]) == Scale(0, 1, "viridis_r", "m")


def test_spots_are_marked_where_their_rays_cross_the_image(
    capture: Capture, tmp_path: Path
) -> None:
    marks = spot_marks(capture)
    assert [k for k, _, _ in marks] == [0, 1, 2, 3]
    positions = [(25, 25), (75, 25), (25, 75), (75, 75)]
    assert [position for _, *position in marks] == [
        pytest.approx(position) for position in positions
    ]
    assert 'style="left:75.00%;top:25.00%;--colour:var(--spot-1)"' in report_of(capture, tmp_path)


def curves(figure: Figure) -> tuple[list[Line2D], list[float]]:
    """The four curves of a plot of spots, and the places of its dashed lines."""
    (axes,) = figure.axes
    lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
    return lines, [line.get_xdata()[0] for line in axes.lines if line not in lines]


def test_the_plot_marks_the_true_path_length_where_the_light_peaks() -> None:
    histogram = np.full((4, 500), 1e-9)
    histogram[:, 250] = 1e-6
    light = SimpleNamespace(spot_histogram=histogram, path_length_m=0.02 * np.arange(500))
    figure = light_figure(light, np.full(4, 5.0))
    assert figure is not None
    lines, marks = curves(figure)
    peaks = [line.get_xdata()[np.argmax(line.get_ydata())] for line in lines]
    assert marks == pytest.approx([5.0] * 4)
    assert peaks == pytest.approx([5.0] * 4)


@pytest.mark.parametrize(
    ("spots", "labels"),
    [
        (1, ["spot 0"]),
        (4, [f"spot {k}" for k in range(4)]),
        (9, ["spots 0, 8", *(f"spot {k}" for k in range(1, 8))]),
        (64, [f"spots {k}, {k + 8}, …" for k in range(8)]),
    ],
)
def test_curves_of_any_number_of_spots_have_labels(spots: int, labels: list[str]) -> None:
    """Spots of one colour share a label."""
    histogram = np.full((spots, 500), 1e-9)
    light = SimpleNamespace(spot_histogram=histogram, path_length_m=0.02 * np.arange(500))
    figure = light_figure(light, np.full(spots, 5.0))
    assert figure is not None
    lines, marks = curves(figure)
    assert len(lines) == len(marks) == spots
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == labels
    file_of(figure, "test")  # lays it out
    assert figure.bbox.x0 <= legend.get_window_extent().x0
    assert [line.get_color() for line in lines] == [colour for colour, _ in spot_looks(spots)]


def test_pages_have_the_colours_of_all_spots_in_light_and_dark(
    capture: Capture, tmp_path: Path
) -> None:
    text = report_of(capture, tmp_path)
    for number in range(len(SPOT_COLOURS)):
        assert len(set(re.findall(rf"--spot-{number}: (#\w+);", text))) == 2
    many = report_of(with_spots(capture, [0, 1, 2, 3] * 16), tmp_path)
    used = set(re.findall(r"var\(--spot-(\d+)\)", many))
    assert used == {str(number) for number in range(len(SPOT_COLOURS))}
    assert many.count('title="spot 63"')


def test_no_light_gives_no_plot() -> None:
    dark = SimpleNamespace(spot_histogram=np.zeros((4, 9)), path_length_m=np.arange(9.0))
    assert light_figure(dark, None) is None


def test_recorded_arrivals_are_drawn_where_their_path_is(capture: Capture, tmp_path: Path) -> None:
    counts = np.zeros((1, 4, 50))
    counts[0, :, 20] = 900
    spots = replace(HISTOGRAMS, counts=counts, start_s=10e-9)
    figure = arrival_figure(spots, 0, np.full(4, 30.5 * 0.299792458))
    assert figure is not None
    lines, (true_m, *_) = curves(figure)
    length_m = lines[0].get_xdata()
    highest_m = length_m[np.argmax(lines[0].get_ydata())]
    assert 0 <= true_m - highest_m <= length_m[1]
    assert arrival_figure(HISTOGRAMS, 0, None) is not None
    assert arrival_figure(replace(HISTOGRAMS, counts=0 * counts), 0, None) is None
    text = report_of(replace(capture, spots=HISTOGRAMS), tmp_path)
    assert "The arrivals as recorded." in text
    assert text.count("<svg") == 2


def test_the_table_of_spots_tells_ranges_that_one_may_have() -> None:
    no_return = dict.fromkeys(("range_m", "error_m", "sigma_m"))
    alternatives = [
        {"range_m": 2.314, "sigma_m": 0.01, "weight": 0.7},
        {"range_m": 2.941, "sigma_m": 0.02, "weight": 0.3},
    ]
    spot = {"true_m": 2.3, "status": "ambiguous", "alternatives": alternatives} | no_return
    (table,) = compared_spots({"spots": {"cw": [spot]}})
    assert table.rows == [
        ("spot 0", "2.300", "ambiguous: 2.31 m (70 %), 2.94 m (30 %)", "–", "–", "ambiguous")
    ]
