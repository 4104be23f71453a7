"""From frames to results: the same as from memory, whatever becomes of sinks and setups."""

import gc
import struct
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

from reconstruction import InputError, Reconstructor, make_plan
from reconstruction.depth import DISTANCES_M
from reconstruction.operators import expose
from spisim_live import Counts, Loop, Reception, Sender
from spisim_live.results import result_entries
from spisim_live.sinks import Detached
from spisim_live.sinks.sink import Sink
from streams import Clock, Script, film, messages

SAFETY_S = 600


@pytest.fixture
def recording(capture):
    return film(capture, 6)


def looped(reported, *, clock=None, patient=False, waiting=1000, **options):
    """A loop after a stream has come in, and what it told."""
    clock = clock or Clock()
    source = Script(*reported, clock=clock, patient=patient)
    reception = Reception(source, clock=clock, waiting=waiting)
    results, states = [], []
    loop = Loop(reception, results=[results.append], states=[states.append], clock=clock, **options)
    reception.run()
    loop.run()
    return loop, results, states


def same(one, other):
    assert list(one.images) == list(other.images)
    assert one.recording == other.recording
    for name in one.images:
        assert one.images[name].tobytes() == other.images[name].tobytes()
    assert one.ranges.range_m.tobytes() == other.ranges.range_m.tobytes()
    assert one.ranges.sigma_m.tobytes() == other.ranges.sigma_m.tobytes()
    for name in one.depths:
        assert one.depths[name].tobytes() == other.depths[name].tobytes()


def test_results_are_those_of_the_same_frames_bit_for_bit(recording):
    reconstruct = Reconstructor(recording.setup, image="edge-preserving")
    _, results, states = looped(messages(recording))
    assert [each.result.frame for each in results] == list(range(6))
    assert [each.time_ns for each in results] == [1000 * n for n in range(6)]
    for number, outcome in enumerate(results):
        same(outcome.result, reconstruct(recording.frame(number)))
    assert states[-1].counts.reconstructed == 6
    assert states[-1].trouble == ""


def test_methods_are_those_that_are_named(recording):
    _, results, _ = looped(messages(recording), image="zero-filled", depth="nearest")
    assert list(results[0].result.images) == ["zero-filled"]
    assert list(results[0].result.depths) == ["nearest"]
    with pytest.raises(InputError, match="did you mean 'nearest'"):
        looped(messages(recording), depth="neerest")


def test_obstacles_are_at_the_probability_that_is_asked_for(recording):
    (near, *_), (far, *_) = (looped(messages(recording), min_free=p)[1] for p in (0.95, 0.3))
    sent = result_entries(near)
    np.testing.assert_array_equal(sent["free_distance_m"], DISTANCES_M)
    np.testing.assert_array_equal(sent["free_probability"], far.result.free_probability)
    assert sent["obstacle_m"] < far.result.obstacle_m
    with pytest.raises(InputError, match="min_free = 2"):
        looped(messages(recording), min_free=2)


def test_a_machine_that_cannot_keep_up_says_what_takes_less_time(recording):
    _, results, states = looped(messages(recording), waiting=2)
    assert len(results) == 2
    assert states[-1].counts.dropped == 4
    assert "4 frames dropped" in states[-1].trouble
    assert "depth anchored" in states[-1].trouble


def test_a_new_setup_is_compiled_and_a_bad_one_is_a_trouble(recording, capture):
    plan = make_plan((16, 16), 100)
    image = np.ones((16, 16))
    counts = expose(plan, image)[None]
    few = replace(capture.buckets, counts=counts, saturated=np.zeros(counts.shape, bool))
    other = replace(capture, plan=plan, buckets=few)
    dark = np.ones(plan.exposures, np.int8)  # shows no complement: the background is not told
    bad = replace(other, plan=replace(plan, polarity=dark))
    output = messages(recording)[:-1]
    number = 6
    for each in (bad, other):
        sender = Sender(each.setup, run=1)
        sender.number = number
        output += [sender.setup(), sender.frame(each.frame(0))]
        number += 1
    loop, results, _ = looped(output)
    assert [each.result.frame for each in results] == [0, 1, 2, 3, 4, 5, 7]
    assert loop.state().counts.failed == 1
    same(results[-1].result, Reconstructor(other.setup, image="edge-preserving")(other.frame(0)))


def test_a_bad_first_setup_of_a_file_is_an_error_and_of_a_link_a_trouble(capture):
    plan = capture.plan
    bad = replace(capture, plan=replace(plan, polarity=np.ones(plan.exposures, np.int8)))
    with pytest.raises(InputError, match="background"):
        looped(messages(bad), patient=True)
    loop, _, states = looped(messages(bad))
    assert loop.state().counts.failed == 1
    assert "background" in states[-1].trouble


def test_a_frame_without_anything_usable_is_told_and_the_next_is_fine(recording):
    recording.buckets.saturated[2] = True
    loop, results, _ = looped(messages(recording))
    assert [each.result.frame for each in results] == [0, 1, 3, 4, 5]
    assert loop.state().counts.failed == 1


def test_a_method_that_raises_anything_costs_its_own_part_of_a_frame(recording, monkeypatch):
    """Not the frame, and not the stream."""
    made = Reconstructor(recording.setup, image="edge-preserving")
    solver = type(
        made._imaging.of(np.ones(recording.plan.exposures, bool)).solver("edge-preserving")
    )
    solve, calls = solver.__call__, []

    def singular(self, coefficients):
        calls.append(1)
        if len(calls) in (2, 3):
            raise np.linalg.LinAlgError("Singular matrix")
        return solve(self, coefficients)

    monkeypatch.setattr(solver, "__call__", singular)
    loop, results, _ = looped(messages(recording))
    counts = loop.state().counts
    assert (counts.reconstructed, counts.failed, counts.method_failures) == (6, 0, 2)
    assert [next(iter(each.result.images)) for each in results[:4]] == [
        "edge-preserving", "zero-filled", "zero-filled", "edge-preserving"
    ]  # fmt: skip
    assert results[1].result.ranges is not None


def test_what_a_frame_raises_is_told_and_the_next_is_fine(recording, monkeypatch):
    batch = Reconstructor.batch

    def odd(self, frames):
        if frames.first == 2:
            raise MemoryError("no room")
        return batch(self, frames)

    monkeypatch.setattr(Reconstructor, "batch", odd)
    loop, results, _ = looped(messages(recording))
    assert [each.result.frame for each in results] == [0, 1, 3, 4, 5]
    assert loop.state().counts.failed == 1


def test_a_setup_that_raises_anything_is_a_trouble(recording, monkeypatch):
    def broken(*args, **named):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("spisim_live.loop.Reconstructor", broken)
    loop, results, _ = looped(messages(recording))
    assert results == []
    assert loop.state().counts.failed == 6
    assert loop.state().trouble.startswith("the setup cannot be used: ZeroDivisionError: division")


def test_names_are_checked_before_anything_comes(recording):
    reception = Reception(Script())
    for station, name in (("image", "zero-fill"), ("ranging", "fogg"), ("depth", "neerest")):
        with pytest.raises(InputError, match="did you mean"):
            Loop(reception, **{station: name})


def test_the_last_result_ages_and_latency_is_told(recording):
    clock = Clock()
    output = messages(recording)
    reception = Reception(Script(*output[:-1], clock=clock), clock=clock, waiting=100)
    states = []

    class Slow(Reconstructor):
        def __call__(self, frame):
            clock.wait(0.02)
            return super().__call__(frame)

    loop = Loop(reception, states=[states.append], clock=clock)
    assert np.isnan(loop.state().age_s)
    assert loop.state().trouble == "waiting for script"
    for _ in output:
        reception.step()
    reconstruct = Slow(recording.setup)
    loop._compile(reception.stream)
    loop._reconstruct = reconstruct
    for _ in range(6):
        loop.step(0)
    assert loop.latencies.percentile(50) == pytest.approx(0.07)
    assert loop.latencies.percentile(100) == pytest.approx(0.12)
    clock.wait(3.0)
    assert loop.state().age_s == pytest.approx(3.12)
    loop.step(0)
    assert states[-1].age_s == pytest.approx(3.12)
    clock.wait(1.5)
    loop.step(0)
    assert states[-1].age_s == pytest.approx(4.62)
    assert states[-1].frames_per_s == 0


def test_it_ends_after_so_many_results(recording):
    clock = Clock()
    reception = Reception(Script(*messages(recording), clock=clock), clock=clock, waiting=100)
    loop = Loop(reception, clock=clock)
    reception.run()
    loop.run(2)
    assert reception.counts.reconstructed == 2


class Stalling(Sink):
    """Takes nothing until it may, and then everything."""

    waiting = 4

    def __init__(self):
        self.may = threading.Event()
        self.stuck = threading.Event()
        self.taken = []
        self.closed = False

    def result(self, outcome):
        self.stuck.set()
        assert self.may.wait(SAFETY_S)
        self.taken.append(outcome)

    def close(self):
        self.closed = True


def test_a_sink_that_stalls_holds_up_nothing_and_goes_on_with_the_newest():
    sink = Stalling()
    detached = Detached(sink, "stalling")
    detached.start()
    detached.result(0)
    assert sink.stuck.wait(SAFETY_S)
    for number in range(1, 2000):  # some seconds of results, at once
        detached.result(number)
    assert detached.dropped == 1995
    sink.may.set()
    detached.close()
    assert sink.taken == [0, 1996, 1997, 1998, 1999]
    assert sink.closed


def blocks():
    """Pieces of memory that Python's objects take."""
    gc.collect()
    return sys.getallocatedblocks()


def test_memory_is_flat_whatever_happens(capture, monkeypatch):
    """The source dies again and again, its clock jumps by an hour, and a sink stalls for 10 s."""
    monkeypatch.setattr("spisim_live.counts.ROLLING", 100)
    few = replace(film(capture, 4), spots=None, optics=None)
    clock, sender, hour = Clock(), Sender(few.setup, run=1), 3600 * 10**9
    source = Script(sender.setup(), clock=clock)
    sink = Stalling()
    detached = Detached(sink, "stalling")
    detached.start()
    reception = Reception(source, clock=clock, wait=clock.wait)
    loop = Loop(reception, image="zero-filled", results=[detached.result], clock=clock)

    def fly(frames):
        for number in range(frames):
            if number % 100 == 99:
                source.acts.append(ConnectionResetError(104, "Connection reset by peer"))
            stamp = number % 3 * hour
            source.acts.append(sender.frame(few.frame(number % 4), stamp) + b"noise")
            while source.acts:
                reception.step()
            clock.wait(1 / 117)
            loop.step(0)

    fly(300)
    before = blocks()
    fly(1170)
    assert blocks() - before < 400  # of one more object for each frame there were 1170
    counts = reception.counts
    assert (counts.reconstructed, counts.connections, counts.lost) == (1470, 15, 0)
    assert detached.dropped > 1400
    sink.may.set()
    detached.close()
    assert sink.taken[-1].result.frame == 1469


@pytest.mark.parametrize(
    "error",
    [OSError(28, "No space left on device"), InputError("no such folder"), ValueError("nan"),
     struct.error("int too large"), MemoryError()],
)  # fmt: skip
def test_a_sink_that_raises_anything_is_told_and_tried_again(error):
    class Failing(Sink):
        taken = ()

        def result(self, outcome):
            if outcome == 2:
                raise error
            self.taken = (*self.taken, outcome)

    counts = Counts()
    sink = Failing()
    detached = Detached(sink, "disk", counts)
    detached.start()
    for number in range(1, 5):
        detached.result(number)
    detached.close()
    assert sink.taken == (1, 3, 4)
    assert detached.trouble is None
    assert detached.failed
    assert detached.why.startswith("disk: ")
    assert (detached.lost, counts.sink_failures) == (1, 1)


def test_a_sink_that_does_not_end_is_given_up(monkeypatch):
    monkeypatch.setattr("spisim_live.sinks.sink.CLOSING_S", 0.05)
    sink = Stalling()
    detached = Detached(sink, "stalling")
    detached.start()
    for number in range(4):
        detached.result(number)
    assert sink.stuck.wait(SAFETY_S)
    detached.close()
    assert detached.failed
    assert "does not finish" in detached.why
    assert detached.dropped == 3
    sink.may.set()
