"""The page of a design: both figures, better and worse, and nothing unescaped."""

import re
from pathlib import Path

import pytest

from designs import finished
from spisim_app.report.style import NARROW_IN, WIDE_IN
from spisim_inverse.design.page import in_words, write_design
from spisim_inverse.design.plots import front_figure, judgement_figure, search_figure


def page_of(tmp_path: Path, **changes: str) -> str:
    write_design(tmp_path / "design.html", finished(tmp_path, **changes))
    return (tmp_path / "design.html").read_text()


def test_the_page_has_both_figures_and_what_was_chosen(tmp_path: Path) -> None:
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page_of(tmp_path)))
    assert "0.133, 0.2, 0.667" in text  # times as fractions
    assert "of the base, unseen scenes" in text
    assert "target-plane" in text
    assert "warehouse" in text
    assert text.count("better") == 2  # typical error of both weathers
    assert text.count("worse") == 2  # spots that lose their range


def test_names_of_users_are_escaped(tmp_path: Path) -> None:
    name = "<script>alert(1)</script>"
    assert name not in page_of(tmp_path, name=name, description=name)


def test_sentences_compare_on_unseen_scenes(tmp_path: Path) -> None:
    first, *lines = in_words(finished(tmp_path))
    assert "has not seen" in first
    assert len(lines) == 4
    assert "0.75 times" in lines[0]


@pytest.mark.parametrize("width_in", [WIDE_IN, NARROW_IN])
def test_all_points_of_front_and_judgement_are_in_view(tmp_path: Path, width_in: float) -> None:
    design = finished(tmp_path)
    figure = front_figure(design, width_in)
    assert figure is not None
    (axes,) = figure.axes
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    for each in (*design.front_judged, design.base_judged):
        assert left < each["range_error_m"] < right
        assert bottom < each["image_nrmse"] < top
    (axes,) = judgement_figure(design, width_in).axes
    assert axes.get_xlim()[0] < 0.75 < axes.get_xlim()[1]
    assert len(search_figure(design, width_in).axes) == 2
