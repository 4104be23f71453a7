"""The framing: every message is found again, whatever stands between them, and nothing else is."""

import gc
import struct
import sys
import zlib
from types import SimpleNamespace

import numpy as np
import pytest

from captures import full_capture
from reconstruction import InputError
from spisim_live import Kind, Message, Parser, pack
from spisim_live.framing import HEADER, MAGIC, MAX_BEGUN, MAX_PAYLOAD_BYTES, header
from streams import messages

MESSAGES = [
    Message(Kind.SETUP, b"setup" * 9, 0, 1, 7, 99),
    Message(Kind.FRAME, MAGIC * 5, 1, 2**64 - 1, 7, 99),
    Message(Kind.FRAME, b"", 2**32 - 1, 0, 2**16 - 1, 2**32 - 1),
    Message(Kind.END),
]


def parsed(content, piece=2**20):
    parser = Parser()
    result = []
    for at in range(0, len(content), piece):
        result += parser.feed(content[at : at + piece])
    return result, parser


@pytest.mark.parametrize("piece", [1, 3, 31, 33, 2**20])
def test_messages_come_back_whole_from_pieces_of_any_size(piece):
    result, parser = parsed(b"".join(map(pack, MESSAGES)), piece)
    assert result == MESSAGES
    assert parser.discarded_bytes == 0


def test_the_bytes_are_as_the_page_says():
    content = pack(Message(Kind.FRAME, b"abc", 5, 6, 7, 8))
    head = struct.pack("<4sBBHIIQI", b"SPI\x1a", 1, 2, 7, 5, 3, 6, 8)
    assert content[:28] == head
    assert content[28:32] == struct.pack("<I", zlib.crc32(head))
    assert content[32:] == b"abc" + struct.pack("<I", zlib.crc32(b"abc"))


@pytest.mark.parametrize("garbage", [b"\0", b"S", b"SPI", MAGIC, MAGIC * 20, b"\xff" * 1000])
def test_garbage_between_messages_is_thrown_away_and_counted(garbage):
    content = garbage + garbage.join(map(pack, MESSAGES)) + garbage
    for piece in (1, 7, 2**20):
        result, parser = parsed(content, piece)
        assert result == MESSAGES
        parser.reset()
        assert parser.discarded_bytes == len(garbage) * (len(MESSAGES) + 1)


def test_every_flipped_bit_is_found_and_the_next_message_is_whole():
    whole = pack(MESSAGES[1])
    for bit in range(8 * len(whole)):
        outliers = bytearray(whole)
        outliers[bit // 8] ^= 1 << bit % 8
        result, parser = parsed(bytes(outliers) + pack(MESSAGES[0]))
        assert result[-1] == MESSAGES[0]
        assert all(each.payload is None for each in result[:-1])
        assert parser.discarded_bytes == len(whole)


def test_of_a_damaged_payload_the_number_is_told():
    outliers = bytearray(pack(MESSAGES[1]))
    outliers[HEADER.size] ^= 1
    result, _ = parsed(bytes(outliers))
    assert result == [MESSAGES[1]._replace(payload=None)]


def test_a_message_that_lacks_bytes_does_not_take_the_next_one_with_it():
    short = pack(Message(Kind.FRAME, b"x" * 200))
    result, _ = parsed(short[:100] + short[150:] + pack(MESSAGES[0]) * 3)
    assert result[-3:] == [MESSAGES[0]] * 3


def announced(length):
    """A header that is right, of a message that never comes."""
    return header(Message(Kind.SETUP), length)


def test_a_header_of_16_mib_keeps_nothing_from_whoever_is_behind_it():
    """32 bytes, and nobody would hear of 16 MiB of frames."""
    for piece in (7, 1200, 2**20):
        result, parser = parsed(announced(MAX_PAYLOAD_BYTES) + b"".join(map(pack, MESSAGES)), piece)
        assert result == MESSAGES
        assert (parser.given_up, parser.discarded_bytes) == (1, HEADER.size)
        assert not parser.waits


def test_headers_within_what_others_announce_are_followed_so_far():
    result, parser = parsed(announced(10_000) * 3 + b"x" * 500 + pack(MESSAGES[1]), 33)
    assert result == [MESSAGES[1]]
    assert parser.given_up == 3


def test_what_does_not_fit_is_not_waited_for():
    seen = []

    def fits(message, length):
        seen.append((message.kind, message.payload, length))
        return length < 100

    parser = Parser(fits)
    assert parser.feed(announced(100)) == []
    assert not parser.waits
    assert parser.feed(pack(MESSAGES[0])) == [MESSAGES[0]]
    assert seen == [(Kind.SETUP, None, 100), (Kind.SETUP, None, 45)]


def test_work_grows_with_the_bytes_however_headers_are_nested(monkeypatch):
    """Else a stranger could have the same ones looked at for ever."""
    summed = 0
    crc32 = zlib.crc32

    def counting(content):
        nonlocal summed
        summed += len(content)
        return crc32(content)

    monkeypatch.setattr("spisim_live.framing.zlib", SimpleNamespace(crc32=counting))
    content = b"".join(announced(20_000 - 32 * n) for n in range(500)) * 6
    _, parser = parsed(content, 1000)
    assert summed < (MAX_BEGUN + 2) * len(content)
    assert len(parser._bytes) < 21_000


def test_another_version_is_told_once_for_each_message():
    result, _ = parsed(pack(MESSAGES[0]._replace(version=2)) + pack(MESSAGES[3]))
    assert [(each.version, each.payload) for each in result] == [(2, None), (1, b"")]


def test_lengths_and_kinds_that_cannot_be_are_no_header():
    for length, kind in ((MAX_PAYLOAD_BYTES + 1, 1), (2**32 - 1, 2), (0, 0), (0, 99)):
        result, _ = parsed(header(Message(kind), length) + pack(MESSAGES[3]))
        assert result == [MESSAGES[3]]
    with pytest.raises(InputError, match="at most"):
        pack(Message(Kind.FRAME, b"\0" * (MAX_PAYLOAD_BYTES + 1)))


def mutated(base, rng):
    """Messages with bytes changed, cut out, repeated or put in, or bytes of chance."""
    if rng.random() < 0.1:
        return rng.bytes(rng.integers(0, 300))
    content = bytearray(base[rng.integers(len(base))])
    for _ in range(rng.integers(0, 4)):
        at = int(rng.integers(0, len(content) + 1))
        match rng.integers(0, 4):
            case 0 if at < len(content):
                content[at] ^= 1 << int(rng.integers(8))
            case 1:
                del content[at : at + int(rng.integers(1, 40))]
            case 2:
                content[at:at] = content[at : at + int(rng.integers(1, 40))]
            case _:
                content[at:at] = (MAGIC, b"\0" * 8, rng.bytes(9))[rng.integers(3)]
    return bytes(content)


def fuzz(inputs):
    """Feed one parser with so many; every message that it takes for sound was sent."""
    base = messages(full_capture()) + [pack(each) for each in MESSAGES]
    base = [each for each in base if len(each) < 4000]
    sound = {each.payload for content in base for each in Parser().feed(content)}
    rng = np.random.default_rng(1)
    parser = Parser()
    taken = 0
    for _ in range(inputs):
        for message in parser.feed(mutated(base, rng)):
            taken += message.payload is not None
            assert message.payload is None or message.payload in sound
        # Up to one whole message that a header promises.
        assert len(parser._bytes) <= HEADER.size + max(map(len, sound)) + 2**17
    return taken


def test_thousands_of_changed_inputs_do_no_harm():
    assert fuzz(5_000) > 1_000


@pytest.mark.slow
def test_a_million_changed_inputs_do_no_harm_and_take_no_memory():
    fuzz(1_000)
    gc.collect()
    before = sys.getallocatedblocks()
    assert fuzz(1_000_000) > 200_000
    gc.collect()
    assert sys.getallocatedblocks() - before < 1_000
