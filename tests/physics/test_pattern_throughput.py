"""Throughput of patterns, from the instrument file to readings, captures, budget and images."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import worlds
from instruments import changed
from reconstruction import Reconstructor
from reconstruction.operators import Throughput
from spisim.budget.image import image_budget
from spisim.budget.link import Target
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light import trace
from spisim.simulation.measurement import record
from spisim.transport import ground_truth

ROOM = worlds.scene(*worlds.room())
TARGET = Target(distance_m=2.0, reflectance=0.5, illuminance_klx=0.0, extinction_per_m=0.0)
DIFFERENTIAL = {"plan__polarity": "differential", "projector__settling_time_s": 0.0}


@cache
def light_of(name: str, scene: Scene = ROOM):
    return trace(
        scene, changed(name), frames=1, spp=16, transport_noise_share=None, seed=0, progress=None
    )


def captured(instrument: Instrument, *, noise: bool = True, seed: int = 1, name: str = "paper"):
    truth = ground_truth(ROOM, instrument)
    return record(ROOM, instrument, light_of(name), [truth], seed=seed, noise=noise)


def test_readings_are_those_of_all_alike_times_the_throughput():
    alike = changed("paper", **DIFFERENTIAL)
    losing = changed("paper", **DIFFERENTIAL, plan__throughput={"spread": 0.1, "edges": 0.3})
    one, other = (captured(each, noise=False).buckets.signal[0] for each in (alike, losing))
    factors = losing.pattern_plan.factors
    assert factors.std() > 0.05
    assert factors[::2].mean() == pytest.approx(1)
    dark = one.min()
    ratio = (other - dark)[factors != 1] / np.maximum(one - dark, 1)[factors != 1]
    lit = (one - dark)[factors != 1] > 1e-3 * one.max()
    np.testing.assert_allclose(ratio[lit], factors[factors != 1][lit], rtol=2e-2)


def test_none_leaves_every_bit():
    instrument = changed("paper")
    capture = captured(instrument)
    ones = changed("paper", plan__throughput={"factors": [1.0] * instrument.pattern_plan.sampled})
    np.testing.assert_array_equal(captured(ones).buckets.counts, capture.buckets.counts)
    assert capture.plan.throughput is None


def test_captures_state_it_only_if_calibrated():
    for stated in (False, True):
        throughput = {"spread": 0.05, "seed": 3, "stated": stated}
        capture = captured(changed("paper", **DIFFERENTIAL, plan__throughput=throughput))
        assert (capture.plan.throughput is not None) == stated


@pytest.mark.parametrize("name", ["paper", "apd", "fga015", "spad", "fog", "hybrid"])
def test_presets_show_none(name):
    instrument = changed(name, plan__polarity="differential")
    capture = captured(instrument, name=name)
    buckets = capture.buckets
    pairs = Throughput(capture.plan, buckets.usable[0])
    found = pairs.estimated(buckets.signal[0], buckets.variance[0])
    assert found is None or np.nanstd(found) < 0.01


def test_a_coupled_amplifier_shows_none():
    coupled = {"noise_pa_per_sqrt_hz": 0.2, "coupling": "ac", "low_cut_hz": 5.0}
    for noise in (False, True):
        instrument = changed("paper", **DIFFERENTIAL, detector__amplifier=coupled)
        buckets = (capture := captured(instrument, noise=noise)).buckets
        pairs = Throughput(capture.plan, buckets.usable[0])
        assert pairs.estimated(buckets.signal[0], buckets.variance[0]) is None


def test_images_correct_themselves():
    """With a spread of 10 %, most of what it costs is won back without a stated throughput."""
    throughput = {"spread": 0.1, "seed": 2}
    instrument = changed("paper", **DIFFERENTIAL, plan__throughput=throughput)
    capture = captured(instrument)
    ideal = captured(changed("paper", **DIFFERENTIAL))
    plan = replace(capture.plan, throughput=np.ones(capture.plan.patterns.rows))
    images = [
        Reconstructor(each.setup)(each.batch(0, 1)).image
        for each in (ideal, replace(capture, plan=plan), capture)
    ]
    ignored, used = (np.sqrt(np.mean((each - images[0]) ** 2)) for each in images[1:])
    assert used < 0.4 * ignored


def test_the_budget_tells_what_is_not_calibrated():
    for stated, expected in ((False, 0.03), (True, 0.0)):
        throughput = {"spread": 0.03, "stated": stated}
        instrument = changed("paper", plan__throughput=throughput)
        budget = image_budget(instrument, TARGET)
        assert budget.throughput_rms == pytest.approx(expected, rel=0.4)
        bare = image_budget(changed("paper"), TARGET)
        assert (budget.correlation < bare.correlation) == (not stated) or stated


BAD = {
    "too short": ({"factors": [1.0, 1.0]}, "lists 2 patterns; the plan displays"),
    "a zero": ({"factors": [0.0]}, "factors"),
    "negative": ({"factors": [-1.0]}, "factors"),
    "nan": ({"factors": [float("nan")]}, "factors"),
    "spread in per cent": ({"spread": 3}, "spread"),
    "edges beyond": ({"edges": 1.0}, "edges"),
    "unknown": ({"edge": 0.1}, "edge"),
}


@pytest.mark.parametrize(("throughput", "message"), BAD.values(), ids=BAD)
def test_bad_throughput_is_refused(throughput, message):
    with pytest.raises(ValueError, match=message):
        changed("paper", plan__throughput=throughput)


def test_per_cent_are_named():
    factors = [97.0] * changed("paper").pattern_plan.sampled
    with pytest.raises(ValueError, match="per cent"):
        changed("paper", plan__throughput={"factors": factors})
