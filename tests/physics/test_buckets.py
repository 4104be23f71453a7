"""Bucket readings of every kind of detector against the light budget."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

import reconstruction
import worlds
from instruments import changed
from reconstruction.base.errors import InputError
from reconstruction.capture import Capture, write_capture
from reconstruction.operators import decoder_for
from spisim.instrument import Instrument, embedded_instrument, load_instrument
from spisim.scene import Ambient, Scene
from spisim.simulation.light import LightSequence, trace
from spisim.simulation.measurement import BucketLight, bucket_light, record
from spisim.simulation.measurement.buckets import record_buckets
from spisim.transport import GroundTruth, ground_truth

POSITION = worlds.scene(
    worlds.plane(4.0, 0.5), ambient=Ambient(sun_klx=20, sun_direction=(0, 0, 1))
)
FRAMES = 1000


@cache
def still(instrument: Instrument, position: Scene = POSITION) -> LightSequence:
    return trace(
        position, instrument, frames=1, spp=16, transport_noise_share=None, seed=0, progress=None
    )


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    return ground_truth(POSITION, load_instrument("paper"))


def capture_of(instrument: Instrument, truth: GroundTruth, *, noise: bool, frames: int) -> Capture:
    light = still(instrument)
    return record(POSITION, instrument, light, [truth], seed=5, noise=noise, frames=frames)


COUNTER = {
    "type": "spad",
    "photoactive_area_mm2": 2.0e-4,
    "detection_efficiency": 0.15,
    "dark_count_rate_hz": 2500,
    "dead_time_s": 50e-9,
    "afterpulse_probability": 0.04,
}
AC = {"noise_pa_per_sqrt_hz": 0.2, "coupling": "ac", "low_cut_hz": 5.0}
SIGNED_ADC = {"bits": 16, "full_scale_electrons": 2e8, "offset_counts": 32768}


def instruments() -> list[Instrument]:
    counter = yaml.safe_load(load_instrument("paper").text)["detector"]
    counter = {k: v for k, v in counter.items() if k not in ("amplifier", "adc")}
    return [
        changed("paper"),
        changed("apd"),
        changed("paper", projector__modulation={"frequencies_hz": [15e6]}),
        changed("paper", detector__amplifier=AC, detector__adc=SIGNED_ADC),
        changed("paper", detector=counter | {"sensor": COUNTER}),
    ]


@pytest.mark.parametrize("instrument", instruments(), ids=["pin", "apd", "modulated", "ac", "spad"])
def test_noise_is_what_the_capture_says(instrument: Instrument, truth: GroundTruth) -> None:
    """Means and variances of many frames against the noise-free readings and `variance`."""
    noisy = capture_of(instrument, truth, noise=True, frames=FRAMES).buckets
    ideal = capture_of(instrument, truth, noise=False, frames=FRAMES).buckets
    assert not noisy.saturated.any()
    signal = noisy.signal
    z = worlds.z_score_exact(signal, ideal.signal.mean(axis=0))
    assert np.abs(z).max() < 5  # of 128 readings
    model = np.maximum(noisy.variance.mean(axis=0), 1e-12)
    ratio = (signal.var(axis=0, ddof=1) / model - 1) / np.sqrt(2 / (FRAMES - 1))
    assert np.abs(ratio).max() < 5
    assert abs(ratio.mean()) * np.sqrt(ratio.size) < 4


@pytest.mark.parametrize("instrument", instruments()[3:], ids=["ac", "spad"])
def test_every_detector_gives_an_image(instrument: Instrument) -> None:
    position = worlds.scene(*worlds.room())
    light = still(instrument, position)
    truth = ground_truth(position, instrument)
    capture = record(position, instrument, light, [truth], seed=1, noise=False)
    metrics = reconstruction.evaluate(reconstruction.reconstruct(capture), capture)
    assert metrics["images"]["pursuit"]["correlation"] > 0.9


def test_coupling_out_the_sun_leaves_room_in_the_converter(truth: GroundTruth) -> None:
    narrow = {"bits": 16, "full_scale_electrons": 5e6, "offset_counts": 32768}
    dc = changed("paper", detector__adc=narrow)
    ac = changed("paper", detector__adc=narrow, detector__amplifier=AC)
    assert capture_of(dc, truth, noise=True, frames=1).buckets.saturated.any()
    assert not capture_of(ac, truth, noise=True, frames=1).buckets.saturated.any()


def test_counter_at_its_limit_is_flagged(truth: GroundTruth) -> None:
    counter = yaml.safe_load(load_instrument("paper").text)["detector"]
    counter = {k: v for k, v in counter.items() if k not in ("amplifier", "adc")}
    slow = changed("paper", detector=counter | {"sensor": COUNTER | {"dead_time_s": 10e-6}})
    assert capture_of(slow, truth, noise=True, frames=1).buckets.saturated.all()


def test_blocked_light_leaves_dark_and_read_noise() -> None:
    dark = worlds.scene(worlds.plane(4.0, 0.0))
    for instrument in instruments()[:2]:
        light = bucket_light(instrument, still(instrument, dark), 1)
        expected = instrument.detector.dark_electrons(instrument.exposure_time_s)
        np.testing.assert_allclose(light.buckets, expected, rtol=1e-12)
        capture = record(
            dark,
            instrument,
            still(instrument, dark),
            [ground_truth(dark, instrument)],
            seed=2,
            frames=500,
        )
        electrons = capture.buckets.signal
        variance = expected * instrument.detector.sensor.excess_noise_factor
        variance += capture.buckets.noise_electrons**2
        ratio = (electrons.var() / variance - 1) / np.sqrt(2 / electrons.size)
        assert abs(ratio) < 4


def test_twice_the_sun_is_twice_the_background() -> None:
    paper = load_instrument("paper")
    dark = paper.detector.dark_electrons(paper.exposure_time_s)
    levels = []
    for klx in (10, 20):
        ambient = Ambient(sun_klx=klx, sun_direction=(0, 0, 1))
        position = worlds.scene(worlds.plane(4.0, 0.5), ambient=ambient)
        light = bucket_light(paper, still(paper, position), 1)
        levels.append(light.buckets[0, -1] - dark)  # the dark exposure
    assert levels[1] == pytest.approx(2 * levels[0], rel=1e-6)


def test_leaking_pixels_cost_contrast_and_nothing_else() -> None:
    position = worlds.scene(*worlds.room())
    black, grey = changed("paper"), changed("paper", projector__on_off_contrast=5.0)
    images = [bucket_light(one, still(one, position), 1) for one in (black, grey)]
    np.testing.assert_allclose(images[1].image, 0.8 * images[0].image, rtol=1e-12)
    decoder = decoder_for(black.pattern_plan)
    decoded = [decoder.decode(light.buckets[0]) for light in images]
    np.testing.assert_allclose(decoded[1], 0.8 * decoded[0], atol=1e-6 * decoded[0].max())


def test_taps_of_every_pattern_hold_the_range_of_every_pixel() -> None:
    """Full basis, no noise: a plane's range at every pixel, and the bucket is the taps' sum."""
    modulation = {"frequencies_hz": [15e6], "taps": {"width": 0.25}}
    plan = {"patterns": 256, "order": "sequency-2d", "polarity": "differential"}
    instrument = changed(
        "paper", projector__shape=[16, 16], projector__modulation=modulation, plan=plan
    )
    position = worlds.scene(worlds.plane(4.0, 0.5))
    truth = ground_truth(position, instrument)
    light = trace(
        position, instrument, frames=1, spp=1024, transport_noise_share=None, seed=0, progress=None
    )
    capture = record(position, instrument, light, [truth], seed=0, noise=False)
    taps = capture.pattern_taps
    assert taps is not None
    assert taps.taps.shape == (1, 512, 4)
    total = taps.electrons(taps.taps).sum(axis=-1)
    np.testing.assert_allclose(total, capture.buckets.signal, rtol=1e-9)
    result = reconstruction.reconstruct(capture)
    range_m = result.depths["dense"] * result.range_over_depth
    np.testing.assert_allclose(range_m, truth.range_m, atol=1e-3)


def test_photodiodes_in_parallel_add_up() -> None:
    position = worlds.scene(worlds.plane(4.0, 0.5))
    one = changed("paper")
    two = changed("paper", detector__positions_m=[[0.05, 0, 0], [0.05, 0, 0]])
    lights = [bucket_light(instrument, still(instrument, position), 1) for instrument in (one, two)]
    np.testing.assert_allclose(lights[1].image, 2 * lights[0].image, rtol=0.02)


def test_taps_of_a_fine_converter_add_up() -> None:
    """Four counts of 31 bits are more than 32 bits hold."""
    adc = {"bits": 31, "full_scale_electrons": 2.0**31, "offset_counts": 0}
    modulation = {"frequencies_hz": [15e6]}
    fine = changed("paper", projector__modulation=modulation, detector__adc=adc)
    exposures = fine.pattern_plan.exposures
    whole, image = np.full((1, exposures), 6e9), np.zeros((1, 64, 64))
    light = BucketLight(image, image, whole, 0 * whole, np.full((1, exposures, 4), 1.5e9))
    buckets, taps = record_buckets(fine, light, np.random.default_rng(0))
    assert taps is not None
    np.testing.assert_array_equal(buckets.counts, taps.taps.astype(np.int64).sum(axis=-1))
    assert buckets.signal == pytest.approx(6e9, rel=1e-3)


def test_patterns_of_a_file_are_shown(tmp_path: Path) -> None:
    """Random grey ones, of a shape that no Hadamard matrix has."""
    patterns = np.random.default_rng(0).random((40, 6, 5)).astype(np.float32)
    np.save(tmp_path / "grey.npy", patterns)
    fields = yaml.safe_load(load_instrument("paper").text)
    fields["projector"] |= {"shape": [6, 5]}
    plan = {"patterns": 40, "order": "natural", "polarity": "single-ended"}
    fields["plan"] = plan | {"basis": "dense", "patterns_file": "grey.npy"}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(fields))
    instrument = load_instrument(tmp_path / "mine.yaml")
    light = still(instrument)
    truth = ground_truth(POSITION, instrument)
    capture = record(POSITION, instrument, light, [truth], seed=5, noise=False)
    level = bucket_light(instrument, light, 1)
    lit = (patterns * level.image[0]).sum(axis=(1, 2))
    change = capture.buckets.signal[0] - lit
    np.testing.assert_allclose(change, change[0], atol=1e-5 * lit.max())
    assert reconstruction.reconstruct(capture).image.shape == (6, 5)
    moved = instrument.at_wavelength(1540)
    assert moved.pattern_plan.patterns.row(3) == pytest.approx(2 * patterns[3] - 1)

    write_capture(capture, tmp_path / "capture.h5")
    np.save(tmp_path / "grey.npy", 1 - patterns)  # of somebody else; only the capture is opened
    own = embedded_instrument(capture.provenance.instrument, tmp_path / "capture.h5").pattern_plan
    np.testing.assert_array_equal(own.patterns.patterns, patterns)
    with pytest.raises(InputError, match="basis dense needs patterns_file"):
        embedded_instrument(capture.provenance.instrument)
    (tmp_path / "grey.npy").unlink()
    reported = yaml.safe_load(capture.provenance.instrument)
    reported["plan"]["patterns_file"] = "capture.h5"
    (tmp_path / "again.yaml").write_text(yaml.safe_dump(reported))
    again = load_instrument(tmp_path / "again.yaml").pattern_plan
    np.testing.assert_array_equal(again.patterns.patterns, patterns)
    (tmp_path / "again.yaml").write_text(capture.provenance.instrument)
    with pytest.raises(InputError, match=r"plan: no patterns_file 'grey.npy'"):
        load_instrument(tmp_path / "again.yaml")
