"""Throughput by pattern: stated by a plan, shown by pairs, by repeats and by a flat field."""

from dataclasses import replace

import numpy as np
import pytest

from images import correlation, natural_image
from reconstruction import Reconstructor, calibration, read_capture, write_capture
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import capture_from_readings
from reconstruction.cli import main
from reconstruction.image import Imaging
from reconstruction.operators import (
    PatternPlan,
    Throughput,
    decoder_for,
    expose,
    make_plan,
    with_throughput,
)
from reconstruction.operators.bases.dense import Dense
from reconstruction.operators.factors import MAX_FACTOR, MIN_FACTOR

SHAPE = (16, 16)
PLAN = make_plan(SHAPE, 120)
PHOTONS = 2e6
KNOWN = {"electrons_per_count": 1.0, "noise_electrons": 0.0}


def scene(seed, shape=SHAPE):
    image = natural_image(shape[0], seed) + 0.05
    return PHOTONS * image / image.sum()


def recorded(plan, image, seed, *, excess=1.0, stated=False):
    """Capture of photon counts, with noise of ``excess`` times their variance."""
    light = expose(plan, image)
    noise = np.sqrt(excess * np.abs(light)) * np.random.default_rng(seed).standard_normal(
        light.shape
    )
    known = plan if stated else replace(plan, throughput=None)
    return capture_from_readings(light + noise, known, about=KNOWN)


def made(capture, method="edge-preserving"):
    return Reconstructor(capture.setup, image=method)(capture.batch(0, 1)).images[method]


def rms(image, truth):
    return float(np.sqrt(np.mean((image - truth) ** 2)) / truth.std())


@pytest.mark.parametrize(("edges", "spread"), [(0.0, 0.03), (0.0, 0.15), (0.5, 0.05)])
def test_pairs_show_the_throughput(edges, spread):
    plan = with_throughput(PLAN, edges=edges, spread=spread, seed=3)
    found = calibration.throughput_of([recorded(plan, scene(1), 1)])
    assert found is not None
    rows = PLAN.distinct[1:]
    shown = found.factors[rows]
    assert np.corrcoef(shown, plan.throughput[rows])[0, 1] > 0.99
    assert np.std(shown / plan.throughput[rows]) < 0.1 * np.std(plan.throughput[rows])


def test_two_recordings_show_it_better_than_one():
    plan = with_throughput(PLAN, spread=0.03, seed=3)
    both = [recorded(plan, scene(seed) / 200, seed) for seed in (1, 2)]
    rows = PLAN.distinct[1:]
    one, two = (
        np.std(calibration.throughput_of(some).factors[rows] - plan.throughput[rows])
        for some in (both[:1], both)
    )
    assert two < 0.9 * one


def test_noise_alone_shows_none():
    found = [calibration.throughput_of([recorded(PLAN, scene(s), s)]) for s in range(40)]
    assert found == [None] * 40


@pytest.mark.parametrize("polarity", ["differential", "single-ended"])
def test_a_flat_field_shows_it(polarity):
    bare = make_plan(SHAPE, 120, polarity=polarity)
    plan = with_throughput(bare, spread=0.1, seed=4)
    flat = recorded(plan, np.full(SHAPE, PHOTONS / 256) + 0.0, 1)
    found = calibration.throughput_of_flat_field(flat)
    rows = bare.distinct[1:]
    error = found.factors[rows] / plan.throughput[rows]
    assert np.std(error / error.mean()) < 0.01
    capture = recorded(plan, scene(2), 2)
    stated = calibration.calibrated(capture, found)
    truth = scene(2)
    if polarity == "single-ended":  # whose readings alone show nothing
        assert rms(made(stated), truth) < 0.7 * rms(made(capture), truth)
    assert rms(made(stated), truth) < rms(made(capture), truth) + 0.02


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_decoding_undoes_a_stated_throughput(polarity):
    plan = with_throughput(make_plan(SHAPE, None, polarity=polarity), spread=0.2, seed=1)
    image = scene(5)
    background = 0.0 if polarity == "signed" else 1e4
    coefficients = decoder_for(plan).decode(expose(plan, image) + background)
    operator = decoder_for(plan).operator
    np.testing.assert_allclose(coefficients, operator.forward(image), rtol=1e-9, atol=1e-3)
    assert operator.usual_noise.std() > 0.05


def test_dense_patterns_have_a_throughput_too():
    patterns = Dense(np.random.default_rng(3).uniform(size=(70, 8, 8)))
    plan = with_throughput(make_plan((8, 8), 40, basis=patterns), spread=0.2, seed=2)
    image = scene(6, (8, 8))
    decoder = decoder_for(plan)
    decoded = decoder.decode(expose(plan, image) + 100)
    np.testing.assert_allclose(decoded, decoder.operator.forward(image), rtol=1e-6, atol=1)


def test_stated_noise_is_that_of_the_coefficients():
    plan = with_throughput(PLAN, spread=0.25, seed=7)
    image, decoded = scene(1), []
    usable = Imaging(plan).of(np.ones(plan.exposures, dtype=bool))
    truth = usable.decoder.operator.forward(image)
    for seed in range(60):
        capture = recorded(plan, image, seed, stated=True)
        buckets = capture.buckets
        decoded.append(usable.decode(buckets.signal[0], buckets.variance[0]))
    z = [(each.values - truth)[1:] / each.noise[1:] for each in decoded]
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1, abs=0.05)
    by_pattern = np.sqrt(np.mean(np.square(z), axis=0))
    assert abs(np.corrcoef(by_pattern, plan.factors_of(plan.distinct)[1:])[0, 1]) < 0.3


@pytest.mark.parametrize("spread", [0.03, 0.15])
def test_images_correct_themselves_where_pairs_show_it(spread):
    plan = with_throughput(PLAN, spread=spread, seed=8)
    gains = []
    for seed in range(6):
        truth = scene(seed)
        capture = recorded(plan, truth, seed)
        ignoring = replace(capture, plan=replace(PLAN, throughput=np.ones(256)))
        ideal, ignored, used = (
            correlation(made(each), truth)
            for each in (recorded(PLAN, truth, seed), ignoring, capture)
        )
        gains.append((used - ignored, ideal - ignored))
    gained, possible = np.mean(gains, axis=0)
    assert gained > 0.4 * possible > 0


def test_images_without_spread_stay_as_they_are():
    for seed in range(10):
        capture = recorded(PLAN, scene(seed), seed)
        known = replace(capture, plan=replace(PLAN, throughput=np.ones(256)))
        np.testing.assert_allclose(made(capture), made(known), rtol=1e-5)


def test_light_that_stays_coherent_keeps_its_differences():
    """Differences are Re <A e, A h e>, whatever the optics A lose: they count for half of it."""
    rows = PLAN.patterns.matrix(PLAN.index) * PLAN.polarity[:, None]
    image = scene(3)
    field = np.sqrt(image).ravel()
    near = np.exp(-((np.arange(16)[:, None] - np.arange(16)) ** 2) / 2)
    passed = (1 + rows) / 2 * field @ np.kron(near, near)
    light = (np.abs(passed) ** 2).sum(axis=1)
    pairs = Throughput(PLAN, np.ones(PLAN.exposures, dtype=bool))
    small = np.full(light.size, 1e-6 * light.mean() ** 2)
    sums, acting = pairs.estimated(light, small), pairs.acting(light, small)
    assert sums[0] > 1.5
    known = PLAN.distinct
    inside = np.abs(np.log(acting[known])) <= np.abs(np.log(sums[known])) + 1e-9
    assert inside.all()
    linear = light.reshape(-1, 2) @ [1, -1]
    expected = (field @ np.kron(near, near)) * ((rows * field) @ np.kron(near, near))
    np.testing.assert_allclose(linear, expected.sum(axis=1)[::2], rtol=1e-6, atol=1e-9)


def test_repeats_show_excess_noise():
    one, two = (recorded(PLAN, scene(3) / times, 9 + times, excess=1.6) for times in (1, 4))
    factor, error = calibration.excess_noise(one, two)
    assert abs(factor - 1.6) < 3 * error
    assert error < 0.3


def test_files_carry_it_and_older_ones_have_none(tmp_path):
    plan = with_throughput(PLAN, spread=0.1, seed=1)
    capture = recorded(plan, scene(1), 1, stated=True)
    write_capture(capture, tmp_path / "a.h5")
    back = read_capture(tmp_path / "a.h5")
    np.testing.assert_array_equal(back.plan.throughput, plan.throughput)
    bare = recorded(plan, scene(1), 1)
    write_capture(bare, tmp_path / "b.h5")
    assert read_capture(tmp_path / "b.h5").plan.throughput is None
    digests = [each.batch(0, 1).digest(each.setup) for each in (capture, bare)]
    assert digests[0] != digests[1]


def test_the_command_calibrates(tmp_path, capsys):
    plan = with_throughput(PLAN, spread=0.1, seed=1)
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        write_capture(recorded(plan, scene(seed), ord(name)), tmp_path / f"{name}.h5")
    files = [str(tmp_path / f"{name}.h5") for name in "abc"]
    out = str(tmp_path / "out.h5")
    command = ["calibrate", files[0], "-o", out]
    assert main([*command, "--pairs", files[2], "--repeat", files[1]]) == 0
    assert "scatter" in capsys.readouterr().out
    assert read_capture(out).plan.throughput is not None
    assert main(["calibrate", out, "-o", str(tmp_path / "d.h5")]) == 2
    assert "already" in capsys.readouterr().err
    write_capture(recorded(make_plan(SHAPE, 60), scene(1), 1), tmp_path / "other.h5")
    assert main([*command, "--overwrite", "--pairs", str(tmp_path / "other.h5")]) == 2
    assert "exposures is 120" in capsys.readouterr().err
    write_capture(recorded(PLAN, scene(1), 1), tmp_path / "even.h5")
    assert main(["calibrate", str(tmp_path / "even.h5"), "-o", str(tmp_path / "e.h5")]) == 2
    assert "noise explains" in capsys.readouterr().err


BAD = {
    "another length": (np.ones(255), r"shape \(255,\).*256 rows"),
    "a zero": (np.append(np.ones(255), 0.0), "row 255 is 0, must be positive"),
    "a negative one": (np.append(-1.0, np.ones(255)), "row 0 is -1, must be positive"),
    "an infinite one": (np.append(np.inf, np.ones(255)), "row 0 is inf, must be positive"),
    "nothing known": (np.full(256, np.nan), "holds no number"),
    "per cent": (np.full(256, 97.0), "median 97.*per cent"),
    "a thousandth": (np.full(256, 1e-3), "median 0.001, expected about 1"),
    "text": (np.full(256, "one"), "expected a number"),
    "far off": (np.append(np.ones(255), 1e3), "row 255 is 1000; allowed"),
}


@pytest.mark.parametrize(("factors", "message"), BAD.values(), ids=BAD)
def test_bad_factors_are_refused(factors, message):
    with pytest.raises(InputError, match=message):
        PatternPlan(SHAPE, PLAN.index, PLAN.polarity, throughput=factors)


@pytest.mark.parametrize(
    ("factors", "message"),
    [
        ([1.0] * 119, "lists 119 patterns; the plan displays 120"),
        ([1.0] * 119 + [0.0], "must be positive"),
        ([1.0] * 119 + [np.nan], "holds nan"),
        ([100.0] * 120, "per cent"),
    ],
)
def test_bad_lists_are_refused(factors, message):
    with pytest.raises(InputError, match=message):
        with_throughput(PLAN, factors)


@pytest.mark.parametrize("limit", [MIN_FACTOR, MAX_FACTOR])
def test_factors_at_the_limits_are_allowed(limit):
    factors = np.ones(PLAN.patterns.rows)
    factors[PLAN.distinct[-1]] = limit
    plan = PatternPlan(SHAPE, PLAN.index, PLAN.polarity, throughput=factors)
    assert plan.throughput[PLAN.distinct[-1]] == limit


def test_what_cannot_be_calibrated_is_refused():
    single = make_plan(SHAPE, 120, polarity="single-ended")
    with pytest.raises(InputError, match="flat field"):
        calibration.throughput_of([recorded(single, scene(1), 1)])
    signed = make_plan(SHAPE, 120, polarity="signed")
    with pytest.raises(InputError, match="dark exposure"):
        calibration.throughput_of_flat_field(recorded(signed, scene(1), 1))
    dim = recorded(PLAN, scene(1) * 0, 1)
    with pytest.raises(InputError, match="not above the dark"):
        calibration.throughput_of_flat_field(dim)
    unknown = replace(dim, buckets=replace(dim.buckets, electrons_per_count=np.nan))
    with pytest.raises(InputError, match="noise of a recording is unknown"):
        calibration.excess_noise(unknown, unknown)


def test_flicker_without_light_is_no_throughput():
    pairs = Throughput(PLAN, np.ones(PLAN.exposures, dtype=bool))
    noise = np.random.default_rng(1).standard_normal(PLAN.exposures)
    assert pairs.estimated(noise, np.full(PLAN.exposures, 0.01)) is None
