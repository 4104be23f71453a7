"""Setups and frames as bytes: they come back as they were, and nonsense is told."""

from dataclasses import replace

import numpy as np
import pytest

from captures import full_capture, make_spots
from reconstruction import InputError, Reconstructor
from reconstruction.capture import Setup
from reconstruction.capture.schema import present_fields
from reconstruction.operators import make_plan
from spisim_live import StreamSetup, frame_payload, packed, setup_payload, unpacked
from streams import film

PARTS = ("buckets", "spots", "pattern_taps")


def alike(one, other):
    """Whether two parts hold the same, of the same types."""
    if one is None or other is None:
        return one is other
    pairs = [(getattr(one, n), getattr(other, n)) for n, _ in present_fields(one)]
    return type(one) is type(other) and all(
        np.asarray(a).dtype == np.asarray(b).dtype and np.array_equal(a, b, equal_nan=True)
        for a, b in pairs
    )


@pytest.fixture(params=["cw", "pulsed", "dtof", None])
def recording(request):
    spots = None if request.param is None else make_spots(request.param)
    taps = full_capture().pattern_taps if request.param == "cw" else None
    return replace(full_capture(), spots=spots, pattern_taps=taps, truth=None)


def test_setup_and_frames_come_back_bit_for_bit(recording):
    stream = StreamSetup(setup_payload(recording.setup, recording.provenance))
    assert stream.setup.digest(0) == recording.setup.digest(0)
    assert all(alike(getattr(stream.setup, n), getattr(recording.setup, n)) for n in PARTS)
    assert stream.setup.optics.tan_half_width == recording.optics.tan_half_width
    assert stream.provenance.source == "simulation"
    assert stream.provenance.instrument == recording.provenance.instrument
    for number in range(recording.frames):
        frame = recording.frame(number)
        payload = frame_payload(frame)
        assert len(payload) == stream.frame_bytes
        copy = stream.frames(payload, number)
        assert copy.first == number
        assert all(alike(getattr(copy, name), getattr(frame, name)) for name in PARTS)


def test_plans_that_take_turns_come_back(capture):
    plans = [make_plan((16, 16), 128, f"random:{seed}") for seed in range(3)]
    dealt = replace(film(capture, 3), plan=plans[0], following_plans=tuple(plans[1:]))
    stream = StreamSetup(setup_payload(dealt.setup))
    assert [stream.setup.digest(n) for n in range(4)] == [dealt.setup.digest(n) for n in range(4)]


def entries(capture):
    return unpacked(setup_payload(capture.setup))


def test_numbers_may_be_of_any_type_that_holds_them_and_flags_left_out(capture):
    reported = entries(capture)
    reported["buckets/counts"] = np.zeros((0, capture.plan.exposures), np.uint16)
    reported["spots/taps"] = np.zeros((0, 4, 4), np.uint16)
    reported["patterns/index"] = reported["patterns/index"].astype(np.uint8)
    for name in ("buckets/saturated", "spots/saturated"):
        del reported[name]
    reported["rig/temperature"] = np.zeros((0, 3), np.float32)
    stream = StreamSetup(repacked(reported))
    counts = np.arange(capture.plan.exposures, dtype=np.uint16)
    taps = np.arange(16, dtype=np.uint16)
    by_name = {"buckets/counts": counts, "spots/taps": taps, "rig/temperature": np.zeros(3, "f4")}
    payload = b"".join(by_name[n].tobytes() for n, v in reported.items() if v.shape[:1] == (0,))
    frame = stream.frames(payload, 5)
    assert frame.buckets.counts.dtype == np.int32
    assert np.array_equal(frame.buckets.counts[0], counts)
    assert np.array_equal(frame.spots.taps[0].ravel(), taps)
    assert not frame.buckets.saturated.any()
    assert frame.spots.saturated.shape == (1, 4, 4)
    assert Reconstructor(stream.setup)(frame).ranges is not None


def repacked(reported):
    """The bytes of entries again, some of which may be plain texts and numbers."""
    kinds = {name: np.asarray(value).dtype.kind for name, value in reported.items()}
    return packed({n: v.item().decode() if kinds[n] == "S" else v for n, v in reported.items()})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"patterns/basis": "hadamrd"}, "did you mean 'hadamard'"),
        ({"patterns/index": None}, "patterns/index is missing"),
        ({"patterns/shape": np.array([15, 16])}, "power"),
        ({"patterns/shape": np.array([1024, 1024])}, "a stream has at most 16384 pixels"),
        ({"patterns/shape": np.array([2.0**40, 2.0**40])}, "a stream has at most 16384 pixels"),
        ({"buckets/counts": np.zeros((0, 7))}, r"buckets/counts has shape \(0, 7\)"),
        ({"buckets/counts": np.zeros((1, 256))}, "a setup has 0 frames"),
        ({"spots/taps": np.zeros((0, 4, 5))}, "spots/"),
        ({"spots/method": "sw"}, "spots/method: unknown"),
        ({"spots/directions": np.zeros((4, 3))}, "unit vectors"),
        ({"buckets/exposure_time_s": -1.0}, "must be positive"),
        ({"buckets/exposure_time_s": np.int64(2**60)}, "exposure_time_s is 1.15292e.18, must be w"),
        ({"source": "moon"}, "source is 'moon'; allowed: hardware, simulation"),
        ({"patterns/order": np.zeros(3)}, "expected a scalar"),
        ({"rig/film": np.zeros((0, 2**23), np.float64)}, "a frame of 67111312 bytes; at most"),
    ],
)
def test_what_is_wrong_with_a_setup_is_named(capture, change, message):
    reported = entries(capture) | {n: v for n, v in change.items() if v is not None}
    reported = {n: v for n, v in reported.items() if n not in change or change[n] is not None}
    with pytest.raises(InputError, match=message):
        StreamSetup(repacked(reported))


@pytest.mark.parametrize(
    ("side", "patterns", "fits"),
    [(64, 2048, True), (64, 4096, True), (128, 512, True), (128, 513, False), (128, 16384, True)],
)
def test_patterns_are_as_many_as_methods_have_room_for(side, patterns, fits):
    plan = make_plan((side, side), patterns, polarity="single-ended")
    none = np.zeros((0, plan.exposures))
    recorded = full_capture()
    buckets = replace(recorded.buckets, counts=none, saturated=none.astype(bool))
    setup = Setup(plan=plan, optics=None, buckets=buckets, spots=None, pattern_taps=None)
    if fits:
        assert StreamSetup(setup_payload(setup)).setup.plan.sampled == patterns
    else:
        with pytest.raises(InputError, match=r"may have 512 of that size, or all but as many"):
            StreamSetup(setup_payload(setup))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x03ab", "ends within an entry"),
        (b"\x01au2\x01\xff\xff\xff\xff", "at most"),
        (b"\x01au2\x01\x02\0\0\0\0", "a has 4 bytes, but 1 are left"),
        (b"\x01au9\x00", "has the type b'u9'; allowed: u1"),
        (b"\x01\x1bu1\x00\0", "is not a valid name"),
        (b"\x01au1\x00\0" * 2, "a comes twice"),
        (b"\x01au1\x09", "9 axes"),
        (b"", "patterns/basis is missing"),
    ],
)
def test_what_is_no_table_is_told(content, message):
    with pytest.raises(InputError, match=message):
        StreamSetup(content)


def test_a_frame_that_cannot_be_of_its_setup_is_told(recording):
    stream = StreamSetup(setup_payload(recording.setup))
    payload = frame_payload(recording.frame(0))
    with pytest.raises(InputError, match=rf"a frame of {len(payload) - 1} bytes; its setup has"):
        stream.frames(payload[:-1], 0)


def test_readings_that_are_not_finite_are_told(capture):
    stream = StreamSetup(setup_payload(capture.setup))
    assert capture.buckets.counts.dtype == np.float64
    with pytest.raises(InputError, match="buckets/counts holds values that are not finite"):
        stream.frames(b"\xff" * stream.frame_bytes, 0)


def test_changed_setups_are_refused_or_read():
    """With a checksum that fits, as a stranger would send."""
    whole = setup_payload(replace(full_capture(), truth=None).setup)
    rng = np.random.default_rng(2)
    refused = 0
    for _ in range(1_500):
        content = bytearray(whole)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(content)))
            content[at] ^= 1 << int(rng.integers(8))
        if rng.random() < 0.2:
            del content[int(rng.integers(len(content))) :]
        try:
            stream = StreamSetup(bytes(content))
            stream.frames(rng.bytes(stream.frame_bytes % 2**16), 0)
        except InputError:
            refused += 1
    assert refused > 500
