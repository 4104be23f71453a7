"""Reception: sources die and come back, senders begin anew, clocks jump; all of it is told."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from reconstruction import InputError, make_plan
from spisim_live import Kind, Message, Reception, Sender, pack
from spisim_live.reception import FIRST_DELAY_S, MAX_DELAY_S
from streams import Clock, Script, film, messages


@pytest.fixture
def recording(capture):
    return film(capture, 8)


def received(*acts, clock=None, patient=False, **options):
    """A reception after its source has done all of this, and the numbers of its frames."""
    clock = clock or Clock()
    source = Script(*acts, clock=clock, patient=patient)
    options.setdefault("waiting", 1000)
    reception = Reception(source, clock=clock, wait=clock.wait, **options)
    reception.run()
    numbers = []
    while (arrival := reception.queue.get(0)) is not None:
        numbers.append(arrival.frame.first)
    return reception, numbers


def counted(reception):
    reported = {name: value for name, value in vars(reception.counts).items() if value}
    return {n: v for n, v in reported.items() if n not in ("received", "connections")}


def test_frames_come_as_they_were_sent(recording):
    reception, numbers = received(b"".join(messages(recording)))
    assert numbers == list(range(8))
    assert counted(reception) == {}
    assert reception.counts.received == 8
    assert reception.failure is None


def test_a_source_that_dies_within_a_message_is_tried_again(recording):
    output = messages(recording)
    clock = Clock()
    source = Script(
        *output[:3],
        output[3][:50],
        ConnectionResetError(104, "Connection reset by peer"),
        *output[5:],
        clock=clock,
    )
    reception = Reception(source, clock=clock, wait=clock.wait, waiting=100)
    while source.acts[0] is not output[5]:
        reception.step()
    assert reception.trouble == "waiting for script: Connection reset by peer"
    source.refusals = 9
    began_s = clock.now_s
    while source.refusals:
        reception.step()
    # 0.1 s, twice as long each time, then every 5 s.
    assert clock.now_s - began_s == pytest.approx(
        FIRST_DELAY_S * (2**6 - 1) + 3 * MAX_DELAY_S, rel=0.1
    )
    reception.run()
    assert reception.trouble is None
    assert reception.counts.connections == 2
    assert counted(reception) == {"lost": 2, "discarded_bytes": 50, "given_up": 1}
    assert reception.counts.received == 6


def test_a_sender_that_begins_anew_needs_no_new_connection(recording):
    first, again = messages(recording, run=1), messages(recording, run=2)
    reception, numbers = received(*first[:-1], *again)
    assert numbers == [*range(8), *range(8)]
    assert counted(reception) == {"restarts": 1}


def test_another_setup_is_for_the_frames_after_it(recording, capture):
    other = replace(capture, plan=make_plan((16, 16), 128, "random:3"))
    more = Sender(other.setup, run=1)
    more.number = 8
    output = [*messages(recording)[:-1], more.setup(), more.frame(other.frame(0))]
    clock = Clock()
    reception = Reception(Script(*output, clock=clock), clock=clock, waiting=100)
    reception.run()
    streams = [reception.queue.get(0).stream for _ in range(9)]
    assert len(set(map(id, streams[:8]))) == 1
    assert streams[8].setup.digest(0) == other.setup.digest(0)


def test_who_comes_late_waits_for_the_next_setup(recording):
    output = messages(recording)
    reception, numbers = received(*output[1:4], output[0], *output[4:])
    assert numbers == [3, 4, 5, 6, 7]
    assert counted(reception) == {"strangers": 3}


def test_damage_is_counted_as_what_it_is(recording):
    output = messages(recording)
    payload, header = bytearray(output[3]), bytearray(output[5])
    payload[60] ^= 1
    header[9] ^= 1
    output[3], output[5] = bytes(payload), bytes(header)
    reception, numbers = received(*output)
    assert numbers == [0, 1, 3, 5, 6, 7]
    assert counted(reception) == {
        "corrupted": 1,
        "lost": 1,
        "discarded_bytes": len(payload) + len(header),
    }


def test_frames_out_of_turn_are_put_in_turn(recording):
    output = messages(recording)
    output[3], output[4] = output[4], output[3]
    reception, numbers = received(*output)
    assert numbers == list(range(8))
    assert counted(reception) == {"reordered": 1}


def test_a_frame_of_another_length_is_refused(recording):
    output = messages(recording)
    sound = output[4]
    fields = np.frombuffer(sound[:28], "<u4")
    short = Message(Kind.FRAME, sound[32:-5], 3, 0, 1, int(fields[6]))
    output[4] = pack(short)
    reception, numbers = received(*output)
    assert numbers == [0, 1, 2, 4, 5, 6, 7]
    assert counted(reception) == {"refused": 1, "lost": 1, "discarded_bytes": len(output[4])}


def test_too_many_frames_push_out_the_oldest(recording):
    output = messages(recording)
    reception, numbers = received(*output, waiting=3)
    assert numbers == [5, 6, 7]
    assert counted(reception) == {"dropped": 5}


def test_a_source_that_can_wait_does(recording):
    reception = Reception(Script(b"".join(messages(recording)), patient=True), waiting=1)
    receiving = threading.Thread(target=reception.run)
    receiving.start()
    numbers = []
    while not reception.queue.over:
        if (arrival := reception.queue.get(1.0)) is not None:
            numbers.append(arrival.frame.first)
    receiving.join(600)
    assert numbers == list(range(8))
    assert counted(reception) == {}


def test_recorders_get_what_a_slow_machine_drops(recording):
    retained = []
    received(*messages(recording), waiting=1, recorders=[retained.append])
    assert [each.frame.first for each in retained] == list(range(8))
    assert pack(retained[3].message) == messages(recording)[4]


def test_the_sender_s_clock_may_jump(recording):
    """By an hour and back: nothing goes by it but what results tell."""
    sender = Sender(recording.setup, run=1)
    reported = [sender.setup()]
    stamps = [10**9, 3_601 * 10**9, 2 * 10**9, 0, 2**64 - 1]
    reported += [sender.frame(recording.frame(n), stamp) for n, stamp in enumerate(stamps)]
    clock = Clock()
    reception = Reception(Script(*reported, clock=clock), clock=clock, waiting=100)
    reception.run()
    arrivals = [reception.queue.get(0) for _ in stamps]
    assert [each.message.time_ns for each in arrivals] == stamps
    assert {each.received_s for each in arrivals} == {clock.now_s}
    assert counted(reception) == {}


def test_a_frame_that_came_early_is_given_when_nothing_follows(recording):
    output = messages(recording)
    clock = Clock()
    source = Script(*output[:3], output[4], None, None, None, None, clock=clock)
    reception = Reception(source, clock=clock, waiting=100)
    while source.acts:
        reception.step()
    assert reception.counts.received == 3
    assert reception.counts.lost == 1


@pytest.mark.parametrize(
    ("first", "message"),
    [
        (Message(Kind.SETUP, b"", version=2), "version 2; this program reads version 1"),
        (Message(Kind.SETUP, b"\x01au1\x00\0"), "its setup cannot be used: patterns/basis is miss"),
    ],
)
def test_another_language_is_an_error_of_a_file_and_a_trouble_of_a_link(recording, first, message):
    reception, numbers = received(pack(first), *messages(recording), patient=True)
    assert message in str(reception.failure)
    assert str(reception.failure).startswith("script: ")
    assert numbers == []
    reception, numbers = received(pack(first), *messages(recording))
    assert reception.failure is None
    assert numbers == list(range(8))
    output = messages(recording)
    clock = Clock()
    source = Script(*output[:3], pack(first), *output[3:], clock=clock)
    reception = Reception(source, clock=clock, waiting=100)
    while len(source.acts) > 7:
        reception.step()
    assert message in reception.trouble
    reception.run()
    assert reception.failure is None
    assert reception.trouble is None
    assert reception.counts.received == 8


def test_a_setup_that_does_not_tell_the_background_is_read(recording):
    """What is wrong with it is told where it is used."""
    sender = Sender(recording.setup)
    assert received(sender.setup())[0].failure is None


def test_a_source_that_can_never_be_opened_is_told_at_once():
    class Never(Script):
        def check(self):
            raise InputError("no such thing")

    with pytest.raises(InputError, match="no such thing"):
        Reception(Never())
