"""Methods given as objects and registered in a process; the examples of the package's docstring."""

import doctest
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import reconstruction
from captures import full_capture
from reconstruction import InputError, Reconstructor, denoiser, reconstruct, register
from reconstruction.base.constants import c
from reconstruction.base.registry import Registry
from reconstruction.capture import CwSpots
from reconstruction.chosen_methods import REGISTRIES, check_methods, warm_up_frames
from reconstruction.depth import DEPTH_METHODS, DepthEstimate
from reconstruction.image import IMAGE_METHODS, Estimate
from reconstruction.ranging import RANGING_METHODS


class Grey:
    """An image method without a title."""

    def __init__(self, value=3.0, name="grey"):
        self.name, self.value = name, value

    def compile(self, operator):
        return lambda coefficients: Estimate(np.full(operator.image_shape, self.value))


class Flat:
    name, needs = "flat", ("spots",)

    def compile(self, context):
        shape = context.setup.plan.shape
        return lambda view: DepthEstimate(np.full(shape, 2.0))


class OwnPhase:
    name, title, reads = "own-phase", "phase of mine", CwSpots

    def compile(self, spots, optics=None):
        return RANGING_METHODS["cw"].compile(spots, optics)


@pytest.fixture
def unregistered(monkeypatch):
    """Registries that forget what a test registers."""
    for registry in REGISTRIES.values():
        monkeypatch.setattr(registry, "_sources", dict(registry._sources))
        monkeypatch.setattr(registry, "_loaded", dict(registry._loaded))


# As objects


def test_objects_of_all_stations_stand_beside_names(capture):
    result = reconstruct(
        capture, image=["pursuit", Grey()], ranging=[OwnPhase(), "cw"], depth=[Flat(), "nearest"]
    )
    assert list(result.images) == ["pursuit", "grey", "zero-filled"]
    assert (result.images["grey"] == 3).all()
    assert list(result.rangings) == ["own-phase", "cw"]
    np.testing.assert_array_equal(result.ranges.range_m, result.rangings["cw"].range_m)
    assert list(result.depths) == ["flat", "nearest"]
    assert "grey" not in IMAGE_METHODS
    assert "own-phase" not in RANGING_METHODS


def test_an_object_alone_is_the_default_method(capture):
    reconstructor = Reconstructor(capture.setup, image=Grey(5.0), ranging=OwnPhase(), depth=Flat())
    (result,) = reconstructor.batch(capture.batch(0, 1))
    assert (result.image == 5).all()
    assert list(result.rangings) == ["own-phase"]
    assert (result.depth_m == 2).all()
    names = list(Reconstructor(capture.setup, image=["usual", Grey()])(capture.frame()).images)
    assert names == ["edge-preserving", "pursuit", "zero-filled", "grey"]


def test_an_object_that_carries_state_is_warmed_up():
    begun = []
    carrying = Grey(name="carrying")
    carrying.title = "carrying"
    carrying.begin = lambda operators, motion: begun.append(len(operators)) or Grey(7.0)
    capture = full_capture()
    assert warm_up_frames(capture.setup, 1, image=carrying, depth=()) == 1
    assert warm_up_frames(capture.setup, 1, image=Grey(), depth=()) == 0
    assert (reconstruct(capture, 1, image=carrying, depth=()).image == 7).all()
    assert begun == [1]


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        (
            {"image": 3},
            "image: 3 is neither the name of a method nor a method: it lacks name and comp",
        ),
        ({"image": ["pursuit", None]}, "image: None is neither"),
        ({"image": gaussian_filter}, "is neither .* `denoiser` makes an image method of a func"),
        ({"depth": 0.5}, "depth: 0.5 is neither .*; depth methods have name and needs and compile"),
        ({"image": Grey}, "image: Grey is a class; give an instance of it"),
        ({"ranging": OwnPhase}, "ranging: OwnPhase is a class; give an instance of it"),
        (
            {"ranging": Grey()},
            "ranging: .*Grey .* lacks reads; ranging methods have name and reads and",
        ),
        ({"depth": Grey()}, "depth: .*Grey .* lacks needs"),
        (
            {"image": SimpleNamespace(compile=len)},
            "image: .* lacks name; image methods have name and",
        ),
        (
            {"image": SimpleNamespace(name="x", compile=5)},
            "image: .* lacks a compile that can be called",
        ),
        ({"image": Grey(name="a/b")}, "image method 'a/b': a name has letters, digits"),
        ({"image": Grey(name="all")}, "image method 'all': .* is none of default, usual, all"),
        ({"image": Grey(name=7)}, "image method 7: a name has"),
        ({"image": [Grey(), Grey()]}, "image method 'grey' is given twice, as different objects"),
        (
            {"image": Grey(name="pursuit")},
            "image method 'pursuit' is registered by reconstruction.image.methods too: give Grey",
        ),
    ],
)
def test_what_is_not_a_method_is_refused(methods, message):
    with pytest.raises(InputError, match=message):
        Reconstructor(full_capture().setup, **methods)
    with pytest.raises(InputError, match=message):
        check_methods(*(methods.get(station) for station in ("image", "ranging", "depth")))


def test_an_object_must_suit_the_recording(capture):
    other = OwnPhase()
    other.reads = type("Other", (CwSpots,), {"method": "other"})
    with pytest.raises(InputError, match="'own-phase' reads 'other' spots, not those of 'cw'"):
        Reconstructor(capture.setup, ranging=other)
    needy = Flat()
    needy.needs = ("pattern_taps",)
    with pytest.raises(InputError, match="depth method 'flat' needs pattern taps, which the rec"):
        Reconstructor(capture.setup, depth=needy)
    with pytest.raises(InputError, match="image method 'grey' returned values that are not fin"):
        reconstruct(capture, image=Grey(np.inf))


# Registered


@pytest.mark.usefixtures("unregistered")
def test_registered_methods_are_known_by_name(capture):
    grey, flat, phase = Grey(), Flat(), OwnPhase()
    register(image=grey, depth=flat, ranging=phase)
    register(image=grey)  # again changes nothing
    assert IMAGE_METHODS["grey"] is grey
    assert "flat" in list(DEPTH_METHODS)
    result = reconstruct(capture, image="grey", ranging="own-phase", depth=["flat", "nearest"])
    assert list(result.images) == ["grey", "zero-filled"]
    assert list(result.rangings) == ["own-phase"]
    assert list(result.depths) == ["flat", "nearest"]
    assert "own-phase" in reconstruct(capture, ranging="all").rangings
    assert list(reconstruct(capture, image=[grey, "grey"]).images) == ["grey", "zero-filled"]


@pytest.mark.usefixtures("unregistered")
def test_a_name_is_not_registered_twice():
    register(image=Grey())
    with pytest.raises(InputError, match=r"'grey' is registered by .*Grey already: give .*Grey an"):
        register(image=Grey())
    with pytest.raises(InputError, match=r"'pursuit' is registered by reconstruction\.image"):
        register(image=Grey(name="pursuit"))
    with pytest.raises(InputError, match=r"'grey' is registered by .*Grey too: give Grey another"):
        Reconstructor(full_capture().setup, image=Grey())
    with pytest.raises(InputError, match=r"depth: .*Grey .* lacks needs"):
        register(depth=Grey(name="other"))
    with pytest.raises(InputError, match="'a b': a name has letters"):
        register(image=Grey(name="a b"))


def test_a_registry_without_a_package_takes_entries():
    registry: Registry[object] = Registry("tool", attribute="TOOL", group="tests.none")
    registry.register("saw", sorted)
    assert dict(registry) == {"saw": sorted}
    with pytest.raises(
        InputError, match=r"tool 'saw' is registered by builtins.sorted already: gi"
    ):
        registry.register("saw", max)


# Denoisers


def test_a_denoiser_gets_image_and_sigma_of_its_method(capture):
    seen = {}

    def twice(image, sigma):
        seen["sigma"] = sigma
        return 2 * image

    images = reconstruct(capture, image=[denoiser(twice), "least-squares"])
    np.testing.assert_allclose(images.image, 2 * images.images["least-squares"], rtol=1e-6)
    assert next(iter(images.images)) == "twice"
    assert images.sigma is None
    np.testing.assert_allclose(seen["sigma"], images.sigmas["least-squares"], rtol=1e-6)


@pytest.mark.usefixtures("unregistered")
def test_a_registered_denoiser_takes_the_name_of_another_method(capture):
    register(image=denoiser(lambda image, sigma: image + 1, "plus"))
    result = reconstruct(capture, image=["plus:zero-filled"])
    np.testing.assert_allclose(result.image, result.images["zero-filled"] + 1, rtol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((3,), "a denoiser is a function of image and sigma, got 3"),
        ((lambda image, sigma: image,), "image method '<lambda>': a name has letters"),
        ((gaussian_filter, "smooth", "persuit"), "unknown image method 'persuit': did you mean"),
    ],
)
def test_what_makes_no_denoiser_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        denoiser(*arguments)


def test_a_denoiser_of_another_shape_is_refused(capture):
    odd = denoiser(lambda image, sigma: image[1:], "odd")
    with pytest.raises(InputError, match=r"'odd' returned float64 of shape \(15, 16\); expected"):
        reconstruct(capture, image=odd)


# The examples


def test_examples_of_the_docstring_do_what_they_show():
    rng = np.random.default_rng(0)
    patterns = rng.integers(0, 2, (300, 256))
    light = patterns @ (100 * rng.random(256))
    phase = 4 * np.pi * 20e6 / c * np.array([1.5, 2.2, 3.1, 4.4])[:, None]
    taps = 6e4 + 2.5e4 * np.cos(phase - np.arange(4) * np.pi / 2)
    histograms = rng.poisson(1.0, (4, 60))
    arrivals_s = 2 * np.array([1.5, 3.0, 4.5, 6.0]) / c
    for spot, arrival_s in enumerate(arrivals_s):
        stamps_s = rng.normal(arrival_s, 0.7e-9, 2000)
        histograms[spot] += np.histogram(stamps_s, 60, (0, 60e-9))[0]
    given = {
        "patterns": patterns,
        "readings": rng.poisson(light),
        "many_readings": rng.poisson(light, (1000, 300)),
        "taps": rng.poisson(taps),
        "histograms": histograms,
        "gaussian_filter": gaussian_filter,
        "reconstruction": reconstruction,
    }
    (test,) = doctest.DocTestFinder(recurse=False).find(reconstruction, globs=given)
    assert len(test.examples) == 14
    assert doctest.DocTestRunner().run(test).failed == 0
    blocks = reconstruction.__doc__.split("\n\n")
    assert max(block.count(">>> ") for block in blocks) <= 5
