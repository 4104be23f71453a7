"""Commands back to whoever sends frames: what they say, and what is none."""

import gc
import struct
import sys
import zlib

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim_live import Kind, Parser, Pose, command, pack, pose_of
from spisim_live.framing import HEADER, Message

REPORTED = Pose((1.5, -2.0, 0.25), (0.0, 0.0, 0.6, 0.8))


def test_a_command_comes_back_as_it_was_told():
    parser = Parser()
    messages = parser.feed(command(REPORTED, 7, 9) + command(None, 8))
    assert [(each.kind, each.number) for each in messages] == [(Kind.COMMAND, 7), (Kind.COMMAND, 8)]
    assert messages[0].time_ns == 9
    assert pose_of(messages[0].payload) == REPORTED
    assert pose_of(messages[1].payload) is None
    assert parser.discarded_bytes == 0


def test_the_bytes_are_as_the_page_says():
    content = command(REPORTED, 7)
    payload = struct.pack("<7d", 1.5, -2.0, 0.25, 0, 0, 0.6, 0.8)
    assert len(content) == 92
    assert content[:28] == struct.pack("<4sBBHIIQI", b"SPI\x1a", 1, 6, 0, 7, 56, 0, 0)
    assert content[32:] == payload + struct.pack("<I", zlib.crc32(payload))


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        (b"\0" * 55, "a pose of 55 bytes; must have 56, or none"),
        (struct.pack("<7d", np.nan, 0, 0, 0, 0, 0, 1), r"position \(nan, 0, 0\) m"),
        (struct.pack("<7d", 0, 0, -np.inf, 0, 0, 0, 1), "must lie within"),
        (struct.pack("<7d", 0, 2e6, 0, 0, 0, 0, 1), "must lie within"),
        (struct.pack("<7d", 0, 0, 0, 0, 0, 0, 0), r"quaternion \(0, 0, 0, 0\); must have len"),
        (struct.pack("<7d", 0, 0, 0, np.nan, 0, 0, 1), "must have length 1"),
    ],
)
def test_what_is_no_pose_is_told(payload, message):
    with pytest.raises(InputError, match=message):
        pose_of(payload)


def test_rounding_of_a_quaternion_is_taken_off():
    pose = pose_of(struct.pack("<7d", 0, 0, 0, 0, 0, 0, 1.004))
    assert pose == Pose()


def fuzz(inputs):
    """What the parser takes for sound was sent, and what tells a pose tells a finite one."""
    rng = np.random.default_rng(2)
    parser = Parser()
    sent = {command(REPORTED, 1)[HEADER.size : -4], b""}
    sound = 0
    for _ in range(inputs):
        content = bytearray(
            command(REPORTED if rng.random() < 0.8 else None, int(rng.integers(2**32)))
        )
        for _ in range(rng.integers(0, 3)):
            at = int(rng.integers(len(content)))
            if rng.random() < 0.5:
                content[at] ^= 1 << int(rng.integers(8))
            else:
                del content[at : at + int(rng.integers(1, 30))]
                content = content or bytearray(b"\0")
        for message in parser.feed(bytes(content)):
            assert message.payload is None or message.payload in sent
            sound += message.payload is not None
        whole = pack(Message(Kind.COMMAND, rng.bytes(int(rng.choice([0, 55, 56, 57])))))
        (message,) = (each for each in Parser().feed(whole))
        try:
            pose = pose_of(message.payload)
        except InputError:
            continue
        assert pose is None or np.isfinite([*pose.position_m, *pose.quaternion]).all()
        assert len(parser._bytes) <= 2**17
    return sound


def test_thousands_of_changed_commands_do_no_harm():
    assert fuzz(3_000) > 500


@pytest.mark.slow
def test_a_million_changed_commands_do_no_harm_and_take_no_memory():
    fuzz(1_000)
    gc.collect()
    before = sys.getallocatedblocks()
    assert fuzz(1_000_000) > 200_000
    gc.collect()
    assert sys.getallocatedblocks() - before < 1_000
