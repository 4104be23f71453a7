"""The network of learned depth: its inputs against closed forms, its layers, its file."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit

from convolutions import convolved, shuffled, unshuffled
from fourspots import TAN_HALF_FIELD, spots_at
from reconstruction.base.errors import InputError
from reconstruction.capture import Optics
from reconstruction.depth import (
    pixel_rays,
)
from reconstruction.depth.methods import learned
from reconstruction.depth.network import FEATURES, VERSION, features, load
from reconstruction.depth.network_input import (
    MAPS,
    NUMBERS,
    VEIL_FROM_M,
    Anchors,
    NetworkInput,
    inputs_of,
    spot_geometry,
    veil,
)

OPTICS = Optics(tan_half_width=TAN_HALF_FIELD, tan_half_height=TAN_HALF_FIELD)
NO_RETURN = Anchors(np.full(4, np.nan), np.full(4, np.nan))
CENTRES = spots_at([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]])


def seen(depth_m, image, **changes):
    """A frame of which the spots' depths are known to a millimetre or so."""
    height, width = image.shape
    rows = ((CENTRES[:, 1] / CENTRES[:, 2] / OPTICS.tan_half_height + 1) * height / 2).astype(int)
    columns = ((CENTRES[:, 0] / CENTRES[:, 2] / OPTICS.tan_half_width + 1) * width / 2).astype(int)
    reported = Anchors(np.log(depth_m[rows, columns]), np.full(4, 1e-3))
    return replace(
        NetworkInput(
            image=image,
            optics=OPTICS,
            directions=CENTRES,
            plain=reported,
            fitted=NO_RETURN,
            lost=np.zeros(4, dtype=bool),
            log_reflectance=np.full(4, np.log(0.3)),
            noise=0.05,
            fraction=0.031,
            max_range_m=10.0,
        ),
        **changes,
    )


def plane(shape=(64, 64), reflectance=0.3):
    """A tilted plane of one reflectance: depth, and light that falls off with its square."""
    x = pixel_rays(OPTICS, shape)[..., 0]
    depth_m = 4.0 / (1 - 1.5 * x)
    return depth_m, 1e3 * reflectance / depth_m**2


def test_by_brightness_a_surface_of_one_reflectance_has_its_very_depth():
    depth_m, image = plane()
    frame = seen(depth_m, image)
    result = inputs_of(frame).maps[10] + frame.mean_log_depth
    within = np.abs(result - np.log(depth_m))
    # The mean of neighbours at the spots, and spots that fade away from where they are.
    assert within.max() < 0.08
    assert np.abs(inputs_of(frame).start - np.log(depth_m)).mean() > 2 * within.mean()


def test_neither_the_unit_of_the_image_nor_the_order_of_spots_matters():
    depth_m, image = plane()
    frame = seen(depth_m, image + 0.3 * np.sin(np.arange(64)))
    expected = inputs_of(frame)
    order = [2, 0, 3, 1]
    shuffled_spots = replace(
        frame,
        image=frame.image * 250,
        directions=frame.directions[order],
        plain=Anchors(*(values[order] for values in frame.plain)),
    )
    result = inputs_of(shuffled_spots)
    for each, other in zip(result, expected, strict=True):
        np.testing.assert_allclose(each, other, atol=1e-5)


def test_a_mirrored_frame_looks_mirrored():
    depth_m, image = plane()
    frame = seen(depth_m, image)
    mirrored = replace(
        frame, image=image[:, ::-1], directions=frame.directions * np.array([-1, 1, 1])
    )
    first, second = inputs_of(frame), inputs_of(mirrored)
    np.testing.assert_allclose(second.start[:, ::-1], first.start, atol=1e-5)
    retained = [number for number in range(MAPS) if number != MAPS - 3]  # all but x
    np.testing.assert_allclose(second.maps[retained][..., ::-1], first.maps[retained], atol=1e-5)
    np.testing.assert_allclose(second.maps[-3], -first.maps[-3][:, ::-1], atol=1e-6)


def test_the_veil_of_a_fog_that_is_known_comes_off():
    alpha, beta, scale, depth = 0.05, 2e-3, 1e4, 6.0
    in_fog = beta * np.exp(-2 * alpha * VEIL_FROM_M) / VEIL_FROM_M
    surface = 0.3 * np.exp(-2 * alpha * depth) / (np.pi * depth**2)
    image = np.full((32, 32), scale * (surface + in_fog))
    fog = {"extinction_per_m": alpha, "backscatter_per_m_sr": beta}
    frame = seen(np.full((32, 32), depth), image, **fog)
    assert veil(frame, spot_geometry(frame)) == pytest.approx(scale * in_fog, rel=1e-6)
    for unknown in (
        replace(frame, extinction_per_m=np.nan),
        replace(frame, log_reflectance=np.full(4, np.nan)),
        replace(frame, plain=NO_RETURN),
    ):
        assert veil(unknown, spot_geometry(unknown)) == 0


@pytest.mark.parametrize("spots", range(5))
def test_any_number_of_spots_makes_inputs_and_an_answer(spots):
    depth_m, image = plane((24, 40))
    frame = seen(depth_m, image)
    unknown = np.arange(4) >= spots
    some = Anchors(*(np.where(unknown, np.nan, values) for values in frame.plain))
    inputs = inputs_of(replace(frame, plain=some, lost=unknown))
    assert inputs.maps.shape == (MAPS, 24, 40)
    assert inputs.numbers.shape == (len(NUMBERS),)
    reported = learned.shipped()(inputs)
    for values in (reported.log_depth, reported.sigma, reported.no_return):
        assert values.shape == (24, 40)
        assert np.isfinite(values).all()


@pytest.fixture(scope="module")
def weights():
    with np.load(learned.WEIGHTS, allow_pickle=False) as reported:
        return dict(reported)


def reference(inputs, weights):
    """The network in double precision, channel by channel."""

    def layer(channels, name):
        return convolved(channels, weights, name)

    def changed_by(channels, name, blocks):
        for number in range(0, 2 * blocks, 2):
            inner = np.maximum(layer(channels, f"{name}.{number}"), 0)
            channels = channels + layer(inner, f"{name}.{number + 1}")
        return channels

    half = unshuffled(inputs.maps.astype(np.float64))
    constant = [np.full(half.shape[1:], number) for number in inputs.numbers]
    retained = np.maximum(layer(np.concatenate([half, constant]), "enter"), 0)
    retained = np.maximum(layer(retained, "before"), 0)
    quarter = changed_by(np.maximum(layer(unshuffled(retained), "down"), 0), "middle", 1)
    eighth = changed_by(np.maximum(layer(unshuffled(quarter), "deeper"), 0), "deep", 2)
    quarter = changed_by(np.maximum(quarter + shuffled(layer(eighth, "rise")), 0), "again", 1)
    retained = np.maximum(retained + shuffled(layer(quarter, "up")), 0)
    return shuffled(layer(np.maximum(layer(retained, "after"), 0), "leave"))


def test_the_network_is_what_its_definition_says(weights):
    depth_m, image = plane((16, 32))
    inputs = inputs_of(seen(depth_m, image))
    change, log_sigma, logit, trust = reference(inputs, weights)
    result = learned.shipped()(inputs)
    start = inputs.start + expit(trust) * (inputs.plain - inputs.start)
    np.testing.assert_allclose(result.log_depth, start + change, atol=1e-4)
    expected = np.exp(np.clip(log_sigma, -4.5, 1) + weights["calibration"][0])
    np.testing.assert_allclose(result.sigma, expected, rtol=1e-3)
    np.testing.assert_allclose(result.no_return, expit(logit), atol=1e-4)


def test_the_file_is_small():
    assert learned.WEIGHTS.stat().st_size < 1_000_000


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"version": np.array(VERSION + 1)}, rf"version of the weights = {VERSION + 1}, must be"),
        ({"deep.3.bias": None}, "missing weights deep.3.bias"),
        ({"calibration": np.array([np.nan])}, "calibration must be finite"),
        ({"limits": np.zeros(3)}, "limits must be finite numbers with 2 axes"),
    ],
)
def test_weights_of_another_kind_are_refused(tmp_path, weights, change, said):
    reported = {name: value for name, value in (weights | change).items() if value is not None}
    np.savez(tmp_path / "w.npz", **reported)
    with pytest.raises(InputError, match=said):
        load(tmp_path / "w.npz")


def test_features_are_as_many_as_their_names(weights):
    depth_m, image = plane()
    frame = seen(depth_m, image)
    assert features(frame, inputs_of(frame)).shape == (len(FEATURES),)
    assert weights["limits"].shape == (2, len(FEATURES))
