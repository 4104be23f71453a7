"""Hostile datagrams under the rig's address: each costs a frame at most."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction import make_plan
from spisim_live import Kind, Message, Parser, Reception, Sender, pack
from spisim_live.framing import MAX_PAYLOAD_BYTES, header
from streams import Clock, Script, film

FRAMES, PERIOD_S = 100, 1 / 30
FAR = (1, 2, 30, 64, 65, 10**6, 2**31, -1, -10, -65, -(10**6))


@pytest.fixture
def stream(capture):
    """A setup, messages of frames, and another setup with a frame."""
    recording = film(capture, 8)
    sender = Sender(recording.setup, run=7)
    setup = sender.setup()
    frames = [sender.frame(recording.frame(n % 8)) for n in range(FRAMES)]
    other = replace(recording, plan=make_plan((16, 16), 128, "random:3"))
    stranger = Sender(other.setup, run=7)
    stranger.number = 12
    return setup, frames, (stranger.setup(), stranger.frame(other.frame(0)))


def received(setup, frames, hostile, *, datagram_bytes=2**16, every_s=PERIOD_S):
    """Number of the frames that come out if datagrams come before others, by their places."""
    clock, given = Clock(), []
    source = Script(clock=clock)
    source.forgeable = True
    reception = Reception(
        source, clock=clock, wait=clock.wait, waiting=1000, recorders=[given.append]
    )
    reception.step()
    place = 0
    for number, content in enumerate(frames):
        repeated = setup if number % 30 == 0 else b""
        for each in (repeated, content):
            for at in range(0, len(each), datagram_bytes):
                for forged in hostile.get(place, ()):
                    reception.take(forged)
                reception.take(each[at : at + datagram_bytes])
                place += 1
        clock.wait(every_s / 2)
        reception.take(b"")
        clock.wait(every_s / 2)
        reception.take(b"")
    clock.wait(0.3)
    reception.take(b"")
    return len({pack(each.message) for each in given} & set(frames))


def hostile_datagrams(stream, number):
    """Of every kind, at the time of a frame of this number."""
    setup, frames, (stranger, strange) = stream
    (sound,) = Parser().feed(frames[number])
    forged = sound._replace(payload=bytes(len(sound.payload)))
    rng = np.random.default_rng(number)
    yield rng.bytes(500)
    yield frames[number][:40] + rng.bytes(300)
    for cut in (2, 31, 32, 36, len(frames[number]) - 1):
        yield frames[number][:cut]
    for ahead in (0, *FAR):
        moved = pack(forged._replace(number=(number + ahead) % 2**32))
        yield moved
        yield moved[:-3]
        yield moved[:-3] + b"xyz"
    for run in (0, 8):
        yield pack(forged._replace(run=run))
        yield pack(forged._replace(run=run, number=10**6))
    yield pack(forged._replace(setup=1))
    yield pack(forged._replace(payload=b"short"))
    yield stranger
    yield stranger + strange
    yield setup[:-9]
    yield pack(Message(Kind.SETUP, b"nothing of the kind", number, 0, 7, 5))
    yield header(Message(Kind.SETUP), MAX_PAYLOAD_BYTES)
    yield header(forged, 2**20)
    yield pack(Message(Kind.END, b"", number, 0, 7))
    yield pack(Message(Kind.COMMAND))
    yield pack(Message(Kind.FRAME, b"", number, version=2))


@pytest.mark.parametrize("datagram_bytes", [2**16, 100])
def test_one_hostile_datagram_costs_a_frame_at_most(stream, datagram_bytes):
    setup, frames, _ = stream
    split = datagram_bytes < len(frames[0])  # then it may cut one frame and replace another
    sizes = [len(setup), *map(len, frames[:12])]
    place = sum(-(-size // datagram_bytes) for size in sizes)
    for kind, forged in enumerate(hostile_datagrams(stream, 12)):
        places = {place + kind % 3: [forged]}
        count = received(setup, frames[:45], places, datagram_bytes=datagram_bytes)
        assert count >= 44 - split, (kind, forged[:32])


@pytest.mark.parametrize("every_s", [0.01, PERIOD_S, 1.0])
def test_copies_that_are_cut_cost_nothing_however_many(stream, every_s):
    setup, frames, _ = stream
    cut = {number: [each[:-5]] for number, each in enumerate(frames[:100])}
    assert received(setup, frames[:100], cut, every_s=every_s) >= 99
    far = pack(Parser().feed(frames[0])[0]._replace(number=10**6))[:-5]
    ahead = {number: [far] for number in range(0, 100, 10)}
    assert received(setup, frames[:100], ahead, every_s=every_s) == 100
