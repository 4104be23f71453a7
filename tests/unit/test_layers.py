"""Readings as layers of networks: those of the simulator, with gradients that are differences."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import worlds
from instruments import changed
from reconstruction.base.errors import InputError
from reconstruction.operators import illumination
from spisim.instrument import load_instrument
from spisim.simulation.light import LightSequence
from spisim.simulation.light.sensitivity import sensitivities
from spisim.simulation.measurement import bucket_light
from spisim.simulation.measurement.buckets import record_buckets
from spisim_inverse.layers import ReadingModel, SceneImage, display, readings, scene

STEP = 1e-6
RNG = np.random.default_rng(0)
MODEL = ReadingModel(
    RNG.uniform(1, 2, (3, 4)),
    dark_level=0.1,
    background=5.0,
    carried=0.07,
    noise_electrons=2.0,
    excess_noise_factor=1.3,
)
PATTERNS = RNG.uniform(0.1, 0.9, (5, 3, 4))
IMAGE = RNG.uniform(0, 1, (2, 3, 4))
MEAN, NORMAL = RNG.uniform(3, 9, (2, 5)), RNG.standard_normal((2, 5))
PART = SceneImage(("a", "b"), IMAGE[0], RNG.standard_normal((2, 3, 4)))
PAIRS = {
    "expected": (readings.expected, readings.expected_vjp, MODEL, (PATTERNS, IMAGE)),
    "noisy": (readings.noisy, readings.noisy_vjp, MODEL, (MEAN, NORMAL)),
    "image": (scene.image_of, scene.image_vjp, PART, (RNG.uniform(0, 1, (4, 2)),)),
}


@pytest.mark.parametrize("name", PAIRS)
def test_products_are_those_of_finite_differences(name):
    forward, backward, part, arrays = PAIRS[name]
    gradient = RNG.standard_normal(forward(part, *arrays).shape)
    products = backward(part, *arrays, gradient)
    for number, (array, product) in enumerate(zip(arrays, products, strict=True)):
        assert product.shape == array.shape
        way = RNG.standard_normal(array.shape)
        ends = []
        for sign in (1, -1):
            moved = [*arrays]
            moved[number] = array + sign * STEP * way
            ends.append((forward(part, *moved) * gradient).sum())
        slope = (ends[0] - ends[1]) / (2 * STEP)
        assert (product * way).sum() == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {
            "projector__on_off_contrast": 20,
            "projector__falloff": 4.0,
            "projector__settling_time_s": 1e-5,
            "detector__amplifier__bandwidth_hz": 2e4,
        },
    ],
)
def test_expected_readings_are_those_of_the_simulator(fields):
    instrument = changed("paper", **fields)
    image = RNG.uniform(0, 1e-9, (64, 64))
    key = SimpleNamespace(image=image, image_error=0 * image, daylight_w=1e-9)
    light = bucket_light(instrument, LightSequence(np.zeros(1), (key,)), 1)
    buckets, _ = record_buckets(instrument, light, None)
    plan = instrument.pattern_plan
    patterns = np.array([illumination(plan, k) for k in range(plan.exposures)], np.float64)
    model = ReadingModel.of(instrument, daylight_w=1e-9)
    mean = readings.expected(model, patterns, image)
    np.testing.assert_allclose(mean, buckets.signal[0], rtol=1e-9)
    assert model.noise_electrons == pytest.approx(
        instrument.imaging.detector.electronics_noise_electrons(instrument.imaging.exposure_time_s)
    )


def test_noise_has_the_variance_of_the_simulators():
    instrument = load_instrument("apd")
    detector, time_s = instrument.imaging.detector, instrument.imaging.exposure_time_s
    model = ReadingModel.of(instrument)
    mean = np.full((1, 20_000), 1e-3 * detector.adc.headroom_electrons)
    drawn = detector.read(mean, time_s, np.random.default_rng(1))
    counted = (drawn.counts - drawn.offset_counts) * drawn.electrons_per_count
    own = readings.noisy(model, mean, np.random.default_rng(2).standard_normal(mean.shape))
    ratio = own.var() / counted.var()
    assert abs(ratio - 1) < 4 * np.sqrt(4 / mean.size)


def test_scenes_are_their_light_and_its_derivative():
    foggy = worlds.scene(worlds.plane(4.0), extinction_per_m=0.08, g=0.8)
    foggy = replace(foggy, atmosphere=replace(foggy.atmosphere, visibility_m=50.0))
    names = ["scene.fog.visibility_m", "scene.fog.albedo"]
    part = SceneImage.traced(foggy, load_instrument("paper"), names, spp=2)
    assert part.names == tuple(names)
    np.testing.assert_array_equal(scene.image_of(part, np.zeros(2)), part.image)
    thinner = scene.image_of(part, np.array([1.0, 0.0]))
    np.testing.assert_allclose(thinner - part.image, part.derivatives[0], atol=1e-16)


def test_derivatives_that_the_light_does_not_have_are_named():
    foggy = worlds.scene(worlds.plane(4.0), extinction_per_m=0.08)
    instrument = load_instrument("paper")
    with pytest.raises(InputError, match=r"'drone.offset_m'"):
        SceneImage.traced(foggy, instrument, ["drone.offset_m"])
    with pytest.raises(InputError, match="at least one"):
        SceneImage.traced(foggy, instrument, [])
    wanted = sensitivities(foggy, ["scene.fog.albedo"])
    plain = SimpleNamespace(image=IMAGE[0], extra={})
    with pytest.raises(InputError, match=r"scene.fog.albedo: the light was traced without"):
        SceneImage.of(plain, wanted)


COUNTER = {
    "type": "spad",
    "photoactive_area_mm2": 2.0e-4,
    "detection_efficiency": 0.15,
    "dark_count_rate_hz": 2500,
    "dead_time_s": 50e-9,
}


def counting():
    detector = yaml.safe_load(load_instrument("paper").text)["detector"]
    kept = {k: v for k, v in detector.items() if k not in ("amplifier", "adc")}
    return {"detector": kept | {"sensor": COUNTER}}


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        (counting(), "detector.sensor.type = spad"),
        (
            {"detector__amplifier__coupling": "ac", "detector__amplifier__low_cut_hz": 5.0},
            "detector.amplifier.coupling = ac",
        ),
        ({"projector__modulation": {"frequencies_hz": [15e6]}}, "projector.modulation"),
    ],
    ids=["spad", "ac", "modulated"],
)
def test_instruments_that_are_not_linear_are_refused(fields, text):
    with pytest.raises(InputError, match=text):
        ReadingModel.of(changed("paper", **fields))


@pytest.mark.parametrize("daylight_w", [-1.0, np.nan, np.inf])
def test_daylight_is_a_power(daylight_w):
    with pytest.raises(InputError, match="daylight_w = "):
        ReadingModel.of(load_instrument("paper"), daylight_w)


def test_what_cannot_be_shown_or_seen_is_named():
    with pytest.raises(InputError, match=r"patterns of shape \(3, 4\)"):
        display.require_shapes(MODEL, PATTERNS[0], IMAGE)
    with pytest.raises(InputError, match=r"patterns of shape \(0, 3, 4\)"):
        display.require_shapes(MODEL, PATTERNS[:0], IMAGE)
    with pytest.raises(InputError, match=r"image of shape \(2, 4, 3\)"):
        display.require_shapes(MODEL, PATTERNS, IMAGE.swapaxes(1, 2))
    display.require_shapes(MODEL, PATTERNS, IMAGE)
    for value in (-0.1, 1.1, np.nan):
        wrong = PATTERNS.copy()
        wrong[1, 2, 3] = value
        with pytest.raises(InputError, match=rf"patterns: the value at \[1, 2, 3\] is {value:g}"):
            display.require_values(wrong, IMAGE)
    with pytest.raises(InputError, match=r"image: the value at \[0, 0, 1\] is nan"):
        display.require_values(PATTERNS, np.where(np.arange(4) == 1, np.nan, IMAGE))
    display.require_values(PATTERNS, IMAGE)


def test_black_and_white_is_a_half_and_more():
    rounded = display.black_and_white(None, np.array([0.0, 0.49, 0.5, 1.0]))
    np.testing.assert_array_equal(rounded, [0, 0, 1, 1])


class TestTorch:
    """Where PyTorch is installed."""

    def test_gradients_pass_its_check(self):
        torch = pytest.importorskip("torch")
        from spisim_inverse.layers import for_torch

        functions = {
            "expected": for_torch.expected_readings,
            "noisy": for_torch.noisy_readings,
            "image": for_torch.scene_image,
        }
        for name, function in functions.items():
            forward, _, part, arrays = PAIRS[name]
            tensors = [torch.tensor(each, requires_grad=True) for each in arrays]
            result = function(part, *tensors)
            np.testing.assert_allclose(result.detach().numpy(), forward(part, *arrays))
            assert torch.autograd.gradcheck(lambda *t, f=function, p=part: f(p, *t), tensors)

    def test_precision_is_that_of_the_tensors(self):
        torch = pytest.importorskip("torch")
        from spisim_inverse.layers import for_torch

        patterns, image = (torch.tensor(each, dtype=torch.float32) for each in (PATTERNS, IMAGE))
        assert for_torch.expected_readings(MODEL, patterns, image).dtype == torch.float32
        assert MODEL.electrons.dtype == np.float64

    def test_rounding_lets_gradients_through(self):
        torch = pytest.importorskip("torch")
        from spisim_inverse.layers import for_torch

        patterns = torch.tensor(PATTERNS, requires_grad=True)
        weight = torch.tensor(RNG.standard_normal(PATTERNS.shape))
        (for_torch.black_and_white(patterns) * weight).sum().backward()
        np.testing.assert_array_equal(patterns.grad.numpy(), weight.numpy())

    def test_bad_patterns_are_refused(self):
        torch = pytest.importorskip("torch")
        from spisim_inverse.layers import for_torch

        image = torch.tensor(IMAGE)
        with pytest.raises(InputError, match="transmittances from 0 to 1"):
            for_torch.expected_readings(MODEL, torch.tensor(PATTERNS + 1), image)
        with pytest.raises(InputError, match="must end in"):
            for_torch.expected_readings(MODEL, torch.tensor(PATTERNS), image[..., :2])


class TestJax:
    """Where JAX is installed."""

    def test_gradients_are_the_products(self):
        jax = pytest.importorskip("jax")
        from spisim_inverse.layers import for_jax

        functions = {
            "expected": for_jax.expected_readings,
            "noisy": for_jax.noisy_readings,
            "image": for_jax.scene_image,
        }
        for name, function in functions.items():
            forward, backward, part, arrays = PAIRS[name]
            gradient = RNG.standard_normal(forward(part, *arrays).shape)
            result, back = jax.vjp(jax.jit(lambda *a, f=function, p=part: f(p, *a)), *arrays)
            np.testing.assert_allclose(result, forward(part, *arrays), rtol=1e-5)
            products = back(jax.numpy.asarray(gradient, result.dtype))
            for own, product in zip(backward(part, *arrays, gradient), products, strict=True):
                np.testing.assert_allclose(product, own, rtol=1e-4, atol=1e-4)

    def test_rounding_lets_gradients_through(self):
        jax = pytest.importorskip("jax")
        from spisim_inverse.layers import for_jax

        slope = jax.grad(lambda patterns: for_jax.black_and_white(patterns).sum())(PATTERNS)
        np.testing.assert_array_equal(slope, np.ones_like(PATTERNS))

    def test_bad_patterns_are_refused_where_they_are_known(self):
        pytest.importorskip("jax")
        from spisim_inverse.layers import for_jax

        with pytest.raises(InputError, match="transmittances from 0 to 1"):
            for_jax.expected_readings(MODEL, PATTERNS + 1, IMAGE)


@pytest.mark.parametrize(("module", "extra"), [("for_torch", "torch"), ("for_jax", "jax")])
def test_a_missing_library_is_named(monkeypatch, module, extra):
    import importlib
    import sys

    monkeypatch.setitem(sys.modules, extra, None)
    monkeypatch.delitem(sys.modules, f"spisim_inverse.layers.{module}", raising=False)
    with pytest.raises(InputError, match=rf"pip install 'spisim\[{extra}\]'"):
        importlib.import_module(f"spisim_inverse.layers.{module}")
