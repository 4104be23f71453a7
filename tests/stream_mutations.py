"""Streams of setups and frames that are changed where it matters, into a loop with all sinks.

    python tests/stream_mutations.py COUNT [SEED]

Checksums are right and tables well formed: what is changed are values, types, shapes and names,
numbers, times and runs, as of a faulty or hostile sender. It ends with one JSON object.
"""

import json
import resource
import sys
import tempfile
import time
import zlib
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from captures import full_capture, make_spots
from reconstruction.base.errors import InputError
from spisim_live import Counts, Kind, Loop, Message, Reception, pack, packed, unpacked
from spisim_live import reception as receiving
from spisim_live.links import NewFile
from spisim_live.setups import frame_payload, setup_payload
from spisim_live.sinks import Detached, sink_to
from spisim_live.sinks.messages import MessageSink
from streams import Clock, Script

ODD = (0, 1, -1, 2, 255, 2**15, 2**31 - 1, 2**63 - 1, 1e-300, 1e30, 1e300, np.nan, np.inf, -np.inf)
WORDS = ("", "cw", "pulsed", "dtof", "hadamard", "dense", "fourier", "electron", "\0", "x" * 3000)
TYPES = ("u1", "i1", "u2", "i4", "i8", "f4", "f8")
FRAMES = 2
SINKS = ("latest", "flight.h5", "flight.stream", "flight.jsonl", "flight.mcap")


class Nowhere(NewFile):
    """An outlet that takes everything."""

    def __init__(self):
        super().__init__(Path())

    def open(self):
        pass

    def send(self, content):
        pass


class Unbounded:
    """As many setups as come: each is to be tried."""

    def take(self, frames, now_s):
        return True


def recordings():
    """Captures of each kind, small."""
    whole = full_capture()
    for method in ("cw", "pulsed", "dtof", None):
        spots = None if method is None else make_spots(method)
        taps = whole.pattern_taps if method == "cw" else None
        yield replace(whole, spots=spots, pattern_taps=taps, truth=None)


def mutated_value(value, rng):
    """An array as something else."""
    if value.dtype.kind == "S":
        return str(rng.choice(WORDS))
    match rng.integers(5):
        case 0:
            with np.errstate(invalid="ignore", over="ignore"):
                return value.astype(f"<{rng.choice(TYPES)}")
        case 1 if value.ndim:
            axis = int(rng.integers(value.ndim))
            return np.repeat(value, int(rng.integers(0, 4)), axis=axis)
        case 2:
            return value.reshape(-1) if value.ndim > 1 else value[..., None]
        case 3 if value.shape[:1] == (0,):
            shape = (0, *(int(rng.choice([0, 1, 3, 2000])) for _ in value.shape[1:]))
            return np.zeros(shape, value.dtype)
    wide = value.astype(np.float64)
    if wide.size:
        wide.flat[int(rng.integers(wide.size))] = rng.choice(ODD)
    with np.errstate(invalid="ignore", over="ignore"):
        return wide if rng.random() < 0.5 else np.nan_to_num(wide).astype(value.dtype)


def mutated_setup(payload, rng):
    """The bytes of a setup with some entries changed, left out or added."""
    reported = {
        name: value.item().decode() if value.dtype.kind == "S" else value
        for name, value in unpacked(payload).items()
    }
    for _ in range(rng.integers(0, 3)):
        name = str(rng.choice(list(reported)))
        match rng.integers(8):
            case 0:
                del reported[name]
            case 1:
                reported[f"rig/{name.replace('/', '_')}"] = np.zeros((0, 3))
            case 2 if not isinstance(reported[name], str):
                reported[str(rng.choice(list(reported)))] = reported[name]
            case _:
                reported[name] = mutated_value(np.asarray(reported[name], order="C"), rng) \
                    if not isinstance(reported[name], str) else str(rng.choice(WORDS))  # fmt: skip
    return packed(reported)


def mutated_frame(payload, size, rng):
    """The bytes of a frame, of the right length, with some numbers changed."""
    content = bytearray((payload * (size // max(len(payload), 1) + 1))[:size])
    for _ in range(rng.integers(0, 4)):
        number = rng.choice(ODD)
        with np.errstate(invalid="ignore", over="ignore"):
            odd = np.array(number).astype(f"<{rng.choice(TYPES)}").tobytes()
        at = int(rng.integers(0, max(size - len(odd), 1)))
        content[at : at + len(odd)] = odd * int(rng.choice([1, 1, 1, 50]))
    return bytes(content[:size])


def mutated(capture, number, rng):
    """A setup and frames of it, as bytes."""
    payload = mutated_setup(setup_payload(capture.setup), rng)
    size = None
    with suppress(InputError):
        size = receiving.StreamSetup(payload).frame_bytes
    reported, run = zlib.crc32(payload), int(rng.choice([0, 1, 1, 1, 1, number % 2**16]))
    stamp = int(rng.choice(np.array([0, 1, 10**18, 2**63, 2**64 - 1], np.uint64)))
    yield pack(Message(Kind.SETUP, payload, 0, stamp, run, reported))
    for frame in range(FRAMES):
        sound = frame_payload(capture.frame(frame % capture.frames))
        changed = mutated_frame(sound, len(sound) if size is None else min(size, 2**20), rng)
        odd = int(rng.choice([frame, 2**32 - 1, rng.integers(2**32)]))
        counted = odd if rng.random() < 0.1 else FRAMES * number + frame
        yield pack(Message(Kind.FRAME, changed, counted, stamp, run, reported))


def fly(count, seed, folder):
    """Feed so many changed streams, and tell what became of them."""
    rng, clock, counts = np.random.default_rng(seed), Clock(), Counts()
    captures = list(recordings())
    source = Script(clock=clock)
    sinks = [Detached(sink_to(str(folder / name)), name, counts) for name in SINKS]
    sinks.append(Detached(MessageSink(Nowhere()), "messages", counts))
    reception = Reception(
        source,
        recorders=[each.frame for each in sinks],
        clock=clock,
        wait=clock.wait,
        counts=counts,
    )
    reception._changes = Unbounded()
    loop = Loop(
        reception,
        results=[each.result for each in sinks],
        states=[each.state for each in sinks],
        clock=clock,
    )
    for each in sinks:
        each.start()
    longest_s, troubles = 0.0, Counter()
    for number in range(count):
        source.acts.extend(mutated(captures[rng.integers(len(captures))], number, rng))
        began_s = time.process_time()
        while source.acts:
            reception.step()
            loop.step(0)
        clock.wait(0.2)
        reception.take(b"")
        loop.step(0)
        while not reception.queue.empty:
            loop.step(0)
        longest_s = max(longest_s, time.process_time() - began_s)
        if loop.state().trouble:
            troubles[loop.state().trouble.split(":")[0][:40]] += 1
    alive = [each.name for each in sinks if each.alive]
    reception.stop()
    for each in sinks:
        each.close()
    return {
        "counts": {name: value for name, value in vars(counts).items() if value},
        "longest_s": longest_s,
        "alive": alive,
        "why": {each.name: each.why for each in sinks if each.why},
        "lost": {each.name: each.lost for each in sinks if each.lost},
        "dropped": {each.name: each.dropped for each in sinks if each.dropped},
        "memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "troubles": troubles.most_common(12),
    }


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        reported = fly(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0, Path(name))
    print(json.dumps(reported))
