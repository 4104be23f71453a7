"""Pictures of results: PNG as others read it, scales that tell the truth, nothing off the edge."""

import io

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from reconstruction.base.png import png
from reconstruction.outputs import pictures
from reconstruction.outputs.pictures import (
    HEIGHT,
    depth_picture,
    image_picture,
    no_return_picture,
    rendered_text,
    sigma_picture,
)
from reconstruction.outputs.scale import GREY, VIRIDIS, Scale


def opened(content):
    with Image.open(io.BytesIO(content)) as picture:
        return np.asarray(picture), picture.info


def test_a_png_is_read_as_it_was_written():
    colours = np.random.default_rng(0).integers(0, 256, (7, 5, 3), np.uint8)
    result, reported = opened(png(colours, "made by somebody: image"))
    assert np.array_equal(result, colours)
    assert reported["Software"] == "made by somebody: image"


@pytest.mark.parametrize(
    ("low", "high"),
    [(0, 1), (-5, 5), (3.2, 3.9), (99, 101), (0, 0.03), (-1e-7, 2e-7), (0, 3e12), (1e5, 100_003)],
)
def test_numbers_beside_a_scale_are_round_and_at_their_places(low, high):
    values, texts, factor = Scale(low, high, GREY).numbers(7)
    assert 3 <= len(values) <= 8
    assert all(low - 1e-9 * (high - low) <= value <= high + 1e-9 * (high - low) for value in values)
    assert len(set(texts)) == len(texts)
    assert max(map(len, texts)) <= 8
    power = factor.removeprefix("×10").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    read = [float(text) * 10.0 ** int(power or 0) for text in texts]
    assert read == pytest.approx(values, rel=1e-9, abs=1e-12 * (high - low))


def test_a_scale_has_as_many_numbers_as_there_is_room_for():
    assert Scale(0, 6, GREY).numbers(7)[1] == [f"{number}" for number in range(7)]
    assert Scale(0, 6, GREY).numbers(6)[1] == ["0", "2", "4", "6"]


def test_colours_go_from_end_to_end_and_no_further():
    grey = Scale(2.0, 4.0, GREY).paint(np.array([1.0, 2.0, 3.0, 4.0, 9.0]))
    assert grey[:, 0].tolist() == [0, 0, 128, 255, 255]
    fractions = np.linspace(0, 1, 300)
    painted = Scale(0.0, 1.0, VIRIDIS).paint(fractions).astype(int)
    assert np.abs(painted - colormaps["viridis_r"](fractions, bytes=True)[:, :3]).max() < 10


def test_letters_cover_what_they_should():
    assert rendered_text("").shape == (HEIGHT, 0)
    assert not rendered_text("  ").any()
    assert np.array_equal(rendered_text("\N{SNOWMAN}"), rendered_text("?"))
    dash, cross = rendered_text("-"), rendered_text("×")
    assert 0 < (dash > 0.5).sum() < (cross > 0.5).sum()
    assert rendered_text("1/f²").shape[1] > rendered_text("1/f").shape[1]


def test_pixels_are_enlarged_as_they_are():
    image = np.add.outer(np.arange(16.0), np.arange(8.0)).astype(np.float32)
    result, reported = opened(image_picture(image, "Image (of a test)", "count"))
    assert reported["Software"] == "made by spisim: image"
    factor = pictures.SIDE // 16
    top, left = pictures.MARGIN + HEIGHT + pictures.GAP, pictures.MARGIN
    centres = result[top + factor // 2 :: factor, left + factor // 2 :: factor][:16, :8]
    low, high = np.percentile(image, (0.5, 99.5))
    assert np.array_equal(centres, Scale(low, high, GREY).paint(image))


def test_nothing_within_reach_looks_unlike_no_depth():
    depth_m = np.array([[np.nan, np.nan], [2.0, 3.0]], np.float32)
    no_return = np.array([[0.2, 0.8], [0.0, 0.9]], np.float32)
    result, _ = opened(depth_picture(depth_m, "Depth", None, None, no_return))
    top, left = pictures.MARGIN + HEIGHT + pictures.GAP, pictures.MARGIN
    half = pictures.SIDE // 2
    centres = result[top + half // 2 :: half, left + half // 2 :: half][:2, :2]
    near, far = Scale(0.0, 1.0, VIRIDIS).paint(np.array([0.0, 1.0])).tolist()
    expected = [[[pictures.NO_DEPTH] * 3, list(pictures.NO_RETURN)], [near, far]]
    assert centres.tolist() == expected


@pytest.mark.parametrize("shape", [(1, 1), (16, 256), (256, 1), (3, 600)])
@pytest.mark.parametrize("value", [0.0, 1e30, np.nan])
def test_every_shape_has_a_picture(shape, value):
    values = np.full(shape, value, np.float32)
    for content in (
        sigma_picture(values, "Deviation"),
        no_return_picture(np.nan_to_num(values).clip(0, 1), "Nothing"),
    ):
        assert opened(content)[0].shape[0] >= pictures.MIN_SIDE
    result, _ = opened(depth_picture(values, "Depth", None, None))
    assert result.shape[0] >= pictures.MIN_SIDE
    if np.isnan(value):
        middle = result[pictures.MARGIN + HEIGHT + pictures.GAP + pictures.MIN_SIDE // 2]
        assert (middle == pictures.NO_DEPTH).all(axis=-1).any()


@pytest.mark.parametrize("title", ["Depth", "A title that is much longer than its picture is wide"])
def test_a_picture_has_a_white_margin_on_all_sides(title):
    result, _ = opened(depth_picture(np.eye(8, dtype=np.float32), title, None, None))
    half = pictures.MARGIN // 2
    for edge in (result[:half], result[-half:], result[:, :half], result[:, -half:]):
        assert (edge == 255).all()


def test_a_label_is_beside_its_cross():
    picture = np.full((100, 100, 3), 90, np.uint8)
    pictures.draw_spot(picture, 50, 20, "5 m")
    assert (picture[:, : 20 - pictures.CROSS - 1] == 90).all()
    assert (picture[50, 20 - pictures.CROSS : 20 + pictures.CROSS + 1] == 255).all()
    assert (picture[:, 20 + 2 * pictures.CROSS :] == 255).any()


def test_labels_stay_within_the_picture():
    for position in ((0, 0), (99, 99), (50, 70)):
        picture = np.full((100, 100, 3), 90, np.uint8)
        pictures.draw_spot(picture, *position, "12.34 m")
        assert (picture == 255).sum() > 30
    pictures.draw_spot(np.zeros((2, 3, 3), np.uint8), 1, 1, "ambiguous")
