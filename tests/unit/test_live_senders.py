"""Whoever sends: one at a time is heard, nobody blinds another, and setups take what they may."""

import socket
import struct
import threading
import zlib
from dataclasses import replace

import pytest

from reconstruction import make_plan
from spisim_live import Kind, Loop, Message, Reception, Sender, pack
from spisim_live import reception as receiving
from spisim_live.framing import MAX_PAYLOAD_BYTES, header
from spisim_live.links.sockets import Tcp, TcpListen
from spisim_live.reception import ENDING_S
from spisim_live.senders import AT_ONCE, MAX_SENDERS, QUIET_S, SECONDS_A_CHANGE, Senders
from streams import Clock, Script, film, messages

FALSE = header(Message(Kind.SETUP), MAX_PAYLOAD_BYTES)
"""A header that is right, of 16 MiB that nobody sends."""


@pytest.fixture
def recording(capture):
    return film(capture, 8)


@pytest.fixture
def other(capture):
    """Frames of another setup."""
    return film(replace(capture, plan=make_plan((16, 16), 128, "random:3")), 8)


def receiving_from(*acts, **options):
    clock = Clock()
    source = Script(*acts, clock=clock)
    reception = Reception(source, clock=clock, wait=clock.wait, waiting=1000, **options)
    return reception, source, clock


def stepped(reception, source):
    """After all acts but the end, numbers and setups of the frames."""
    while source.acts:
        reception.step()
    arrivals = []
    while (arrival := reception.queue.get(0)) is not None:
        arrivals.append((arrival.frame.first, arrival.stream.id))
    return [number for number, _ in arrivals], {setup for _, setup in arrivals}


def test_a_false_header_costs_no_frame(recording):
    output = messages(recording)
    reception, source, _ = receiving_from(output[0], FALSE, *output[1:-1])
    assert stepped(reception, source)[0] == list(range(8))
    assert reception.counts.given_up == 1
    assert reception.counts.discarded_bytes == len(FALSE)


def test_lengths_are_compared_with_the_setup_s(recording):
    output = messages(recording)
    setup = Message(Kind.FRAME, b"x" * 7, 3, 0, 1, zlib.crc32(output[0][32:-4]))
    reception, source, _ = receiving_from(output[0], pack(setup), *output[1:-1])
    assert stepped(reception, source)[0] == list(range(8))
    assert reception.counts.refused == 1


def test_what_does_not_come_on_is_given_up(recording):
    output = messages(recording)
    reception, source, clock = receiving_from(*output[:3], output[3][:40], b"")
    while source.acts:
        reception.step()
    assert reception.counts.given_up == 0
    clock.wait(QUIET_S + 0.1)
    reception.take(b"")
    assert reception.counts.given_up == 1
    assert reception.counts.discarded_bytes == 40


def test_senders_of_datagrams_do_not_share_a_parser(recording, other):
    """And who is heard is heard alone, so that no other one's setup or end takes its stream."""
    mine, theirs = messages(recording), messages(other)
    pieces = [("them", theirs[0][:50]), ("me", mine[0]), ("them", theirs[0][50:])]
    pieces += [("me", each) for each in mine[1:-1]]
    pieces[5:5] = [("them", each) for each in theirs]  # an end among them
    reception, source, _ = receiving_from(*pieces)
    numbers, setups = stepped(reception, source)
    assert numbers == list(range(8))
    assert len(setups) == 1
    assert reception.counts.ignored_bytes == sum(map(len, theirs)) + len(theirs[0]) - 50
    assert not reception.over


def test_who_is_quiet_loses_its_place(recording, other):
    mine, theirs = messages(recording), messages(other, run=2)
    reception, source, clock = receiving_from(*[("me", each) for each in mine[:4]])
    assert stepped(reception, source)[0] == [0, 1, 2]
    source.acts += [("them", each) for each in theirs[:3]]
    assert stepped(reception, source)[0] == []
    clock.wait(QUIET_S + 0.1)
    source.acts += [("them", each) for each in theirs[:3]]
    source.acts += [("me", each) for each in mine[4:]]  # too late
    assert stepped(reception, source)[0] == [0, 1]
    assert not reception.over


def test_of_any_number_of_senders_few_are_kept():
    senders = Senders(lambda message, length: True)
    for number in range(100):
        senders.feed(f"10.0.0.{number}", FALSE, 0.0)
    assert len(senders._parsers) == MAX_SENDERS
    assert senders.given_up == 100 - MAX_SENDERS
    senders.give_up(QUIET_S + 0.1)
    assert senders.given_up == 100
    assert senders.discarded_bytes == 100 * len(FALSE)


def test_nobody_ends_a_stream_before_it_has_begun(recording):
    reception, source, _ = receiving_from(("them", pack(Message(Kind.END))), *messages(recording))
    assert stepped(reception, source)[0] == list(range(8))
    assert reception.over


def test_an_end_that_may_be_forged_is_true_if_nothing_follows(recording):
    output = messages(recording)
    reception, source, clock = receiving_from(*output[:4], output[-1], *output[4:])
    source.forgeable = True
    assert stepped(reception, source)[0] == list(range(8))
    clock.wait(ENDING_S / 2)
    reception.take(b"")
    assert not reception.over
    clock.wait(ENDING_S)
    reception.take(b"")
    assert reception.over


def test_a_caller_that_says_nothing_gives_way_to_one_that_does(recording):
    clock = Clock()
    listening = TcpListen("tcp-listen://", "127.0.0.1", 0)
    reception = Reception(listening, clock=clock, wait=clock.wait, waiting=100)
    position = ("127.0.0.1", listening.port)
    quiet, rig = Tcp("quiet", *position), Tcp("rig", *position)
    quiet.open()
    while not reception.counts.connections:
        reception.step()
    assert reception.awaited[0].startswith("a setup from 127.0.0.1:")
    clock.wait(QUIET_S + 0.1)
    reception.step()
    assert reception.counts.connections == 1  # nobody else wants its place
    rig.open()
    rig.send(b"".join(messages(recording)))
    receiver = threading.Thread(target=reception.run)
    receiver.start()
    receiver.join(60)
    assert reception.counts.received == 8
    assert reception.counts.connections == 2
    for each in (quiet, rig):
        each.close()


def test_what_is_waited_for_and_since_when_is_told(recording):
    output = messages(recording)
    reception, source, clock = receiving_from(*output[:3])
    loop = Loop(reception, clock=clock)
    clock.wait(3.0)
    state = loop.state()
    assert (state.waiting_for, state.waiting_s) == ("script", pytest.approx(3.0))
    reception.step()
    clock.wait(1.0)
    assert (loop.state().waiting_for, loop.state().waiting_s) == ("a setup from script", 1.0)
    while source.acts:
        reception.step()
    clock.wait(5.0)
    assert loop.state().waiting_for == "a frame from script"
    assert loop.state().numbers["waiting_s"] == pytest.approx(5.0)


def test_a_storm_of_setups_is_bounded_and_passes(recording):
    """Each would be compiled, and begin another file."""
    reception, source, clock = receiving_from()
    for seed in range(40):
        plan = make_plan((16, 16), 128, f"random:{seed}")
        sender = Sender(replace(recording, plan=plan).setup, run=1)
        sender.number = seed
        source.acts += [sender.setup(), sender.frame(recording.frame(0))]
    numbers, setups = stepped(reception, source)
    assert len(setups) == len(numbers) == AT_ONCE
    assert reception.counts.refused == 40 - AT_ONCE
    assert reception.trouble == "script: its setup changes too often"
    clock.wait(SECONDS_A_CHANGE)
    source.acts += messages(recording, run=2)
    assert stepped(reception, source)[0] == list(range(8))


def test_what_nobody_has_foreseen_costs_a_message_alone(recording, monkeypatch):
    class Odd(receiving.StreamSetup):
        def frames(self, payload, number):
            if number == 3:
                raise OverflowError("too much")
            return super().frames(payload, number)

    monkeypatch.setattr(receiving, "StreamSetup", Odd)
    reception, source, _ = receiving_from(*messages(recording))
    assert stepped(reception, source)[0] == [0, 1, 2, 4, 5, 6, 7]
    assert reception.counts.refused == 1
    assert reception.failure is None


def test_a_link_that_raises_anything_is_opened_again(recording):
    """As pySerial's does where its port is pulled out."""
    output = messages(recording)
    reception, source, _ = receiving_from(*output[:4], TypeError("no port"), *output[4:-1])
    assert stepped(reception, source)[0] == list(range(8))
    assert reception.counts.connections == 2


def listening_reception():
    clock = Clock()
    listening = TcpListen("tcp-listen://", "127.0.0.1", 0)
    reception = Reception(listening, clock=clock, wait=clock.wait, waiting=100)
    return reception, clock, ("127.0.0.1", listening.port)


def test_broken_callers_delay_nobody(recording):
    """They have gone before they are let in."""
    reception, clock, position = listening_reception()
    for number in range(60):
        caller = socket.create_connection(position)
        if number % 2:
            caller.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        caller.close()
    rig, began_s = Tcp("rig", *position), clock.now_s
    rig.open()
    rig.send(b"".join(messages(recording)))
    for _ in range(400):
        reception.step()
        if reception.counts.received == 8:
            break
    assert reception.counts.received == 8
    assert clock.now_s - began_s < 0.5
    reception.stop()
    rig.close()


def test_a_caller_without_frames_gives_way_though_it_repeats_its_setup(recording):
    reception, clock, position = listening_reception()
    idle, rig = Tcp("idle", *position), Tcp("rig", *position)
    idle.open()
    setup, *frames = messages(recording)
    for _ in range(4):
        idle.send(setup)
        while not reception.counts.connections or reception.stream is None:
            reception.step()
        clock.wait(1.0)
        reception.step()
    rig.open()
    rig.send(setup + b"".join(frames))
    for _ in range(400):
        reception.step()
        if reception.counts.received == 8:
            break
    assert (reception.counts.received, reception.counts.connections) == (8, 2)
    reception.stop()
    for each in (idle, rig):
        each.close()
