"""Frames in turn, queues that drop the oldest, latencies: what is counted, and as what."""

import threading

import numpy as np
import pytest

from spisim_live.counts import ROLLING, Counts, Latencies
from spisim_live.queues import BoundedQueue
from spisim_live.sequence import ASTRAY, HOLD_S, REMEMBERED, Sequence


def taken(numbers, window=1, run=1):
    """Numbers as they are given, and what was counted; negative ones come damaged."""
    counts = Counts()
    turn = Sequence(counts, window)
    given = []
    for number in numbers:
        item = None if number < 0 else number
        given += turn.take(run, abs(number) % 2**32, item, 0.0)
    given += turn.flush()
    return given, {name: value for name, value in vars(counts).items() if value}


@pytest.mark.parametrize(
    ("numbers", "given", "counted"),
    [
        ([1, 2, 3], [1, 2, 3], {}),
        ([1, 3, 4], [1, 3, 4], {"lost": 1}),
        ([1, 3], [1, 3], {"lost": 1}),
        ([1, 3, 2, 4], [1, 2, 3, 4], {"reordered": 1}),
        ([1, 2, 2, 3], [1, 2, 3], {"duplicated": 1}),
        ([1, 3, 3, 2], [1, 2, 3], {"duplicated": 1, "reordered": 1}),
        ([1, 3, 4, 2, 5], [1, 3, 4, 5], {"late": 1}),
        ([1, 3, 4, 2, 2, 5], [1, 3, 4, 5], {"late": 1, "duplicated": 1}),
        ([1, 9, 10], [1, 9, 10], {"lost": 7}),
        ([1, -2, 3], [1, 3], {}),
        ([1, -2, 2, 3], [1, 2, 3], {}),
        ([1, 3, -2, 4], [1, 3, 4], {}),
        ([1, 3, 4, -2, 5], [1, 3, 4, 5], {}),
        ([1, 4, 5, 3, 2], [1, 4, 5], {"late": 2}),
        ([2**32 - 1, 2**32, 2**32 + 1], [2**32 - 1, 2**32, 2**32 + 1], {}),
        ([2**32 - 2, 2**32, 2**32 - 1], [2**32 - 2, 2**32 - 1, 2**32], {"reordered": 1}),
    ],
)
def test_what_is_given_and_counted(numbers, given, counted):
    assert taken(numbers) == (given, counted)


def test_one_false_number_does_not_make_all_that_follow_late():
    """A frame of the same run, far ahead, with which none agrees."""
    counts = Counts()
    turn = Sequence(counts, 1)
    given = []
    for now_s, number in enumerate([1, 2, 10**6, *range(3, 100)]):
        given += turn.take(1, number, number, now_s)
        given += turn.overdue(now_s)
    assert given == list(range(1, 100))
    assert (counts.refused, counts.restarts, counts.lost) == (1, 0, 0)


def test_a_gap_is_far_only_for_one_frame():
    counts = Counts()
    turn = Sequence(counts, 1)
    far = 10**6
    given = [turn.take(1, number, number, 0.0) for number in (1, far, far, far + 1, far + 2)]
    assert given == [[1], [], [], [far, far + 1], [far + 2]]
    assert (counts.lost, counts.duplicated) == (far - 2, 1)
    assert turn.take(1, 2 * far, 2 * far, 0.0) == []
    assert turn.flush() == [2 * far]


def test_numbers_far_back_again_and_again_are_a_restart():
    assert taken([500, *range(ASTRAY + 3)])[0] == [500, *range(ASTRAY - 1, ASTRAY + 3)]


def test_a_wider_window_waits_for_more():
    assert taken([1, 4, 3, 2, 5], window=3) == ([1, 2, 3, 4, 5], {"reordered": 2})
    assert taken([1, 3, 2], window=0) == ([1, 3], {"late": 1})


def test_an_early_frame_is_not_held_for_ever():
    counts = Counts()
    turn = Sequence(counts, 5)
    assert turn.take(1, 1, "a", 0.0) == ["a"]
    assert turn.take(1, 3, "c", 1.0) == []
    assert turn.overdue(1.0 + HOLD_S / 2) == []
    assert turn.overdue(1.0 + 2 * HOLD_S) == ["c"]
    assert counts.lost == 1


def test_a_sender_that_begins_anew_is_no_late_one():
    counts = Counts()
    turn = Sequence(counts, 1)
    for number in (500, 501, 503):
        turn.take(1, number, number, 0.0)
    assert turn.take(2, 0, 0, 0.0) == [503, 0]
    assert (counts.restarts, counts.lost, counts.late) == (1, 1, 0)


def test_one_that_tells_no_run_is_known_by_its_numbers():
    assert taken([500, 0, 1], run=0) == ([500, 0, 1], {"restarts": 1})
    assert taken([REMEMBERED - 1, 0, 1], run=0)[1] == {"duplicated": 2}
    assert taken([500, 0, 1], run=3)[1] == {"duplicated": 2}


def test_chance_loses_no_count():
    """Whatever order numbers come in, each is given once in turn, or counted."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        sent = np.arange(300)
        retained = sent[rng.random(300) > 0.1]
        retained = retained[np.argsort(retained + rng.uniform(0, 4, retained.size))]
        first = retained[0]
        given, counted = taken([int(n) for n in retained], window=int(rng.integers(0, 5)))
        assert given == sorted(set(given))
        late = counted.get("late", 0) + counted.get("duplicated", 0)
        assert len(given) + late == retained.size
        assert counted.get("lost", 0) == max(retained) + 1 - first - len(given) - counted.get(
            "late", 0
        )


def test_memory_does_not_grow():
    counts = Counts()
    turn = Sequence(counts, 3)
    for number in range(0, 50_000, 2):
        turn.take(1, number, number, 0.0)
    assert counts.lost >= 24_990
    assert len(turn._missing) <= REMEMBERED
    assert len(turn._held) <= 3


def test_the_oldest_gives_way():
    waiting = BoundedQueue(3)
    for number in range(10):
        waiting.put(number)
    assert waiting.dropped == 7
    assert [waiting.get(0) for _ in range(4)] == [7, 8, 9, None]


def test_who_puts_in_turn_waits_for_room_and_not_after_the_end():
    waiting = BoundedQueue(1)
    waiting.put_in_turn(1)
    second = threading.Thread(target=waiting.put_in_turn, args=(2,))
    second.start()
    assert waiting.get(60) == 1
    second.join(60)
    assert waiting.get(60) == 2
    waiting.put(3)
    blocked = threading.Thread(target=waiting.put_in_turn, args=(4,))
    blocked.start()
    waiting.close()
    blocked.join(60)
    assert not blocked.is_alive()
    assert waiting.get(60) == 3
    assert waiting.get(60) == 4
    assert waiting.over
    assert waiting.get(60) is None


def test_what_waits_is_bounded_in_bytes_too(monkeypatch):
    monkeypatch.setattr("spisim_live.queues.MAX_BYTES", 1000)
    waiting = BoundedQueue(100)
    for number in range(5):
        waiting.put(number, 400)
    assert waiting.dropped == 3
    waiting.put(5, 2000)  # alone, as it is
    assert (waiting.get(0), waiting.get(0)) == (5, None)
    waiting.put(6, 400)
    waiting.clear()
    assert waiting.get(0) is None
    assert waiting.dropped == 6


def test_latencies_are_of_the_latest_frames():
    latencies = Latencies()
    assert np.isnan(latencies.percentile(99))
    for _ in range(ROLLING):
        latencies.add(100.0)
    for number in range(ROLLING):
        latencies.add(number / ROLLING)
    assert latencies.percentile(50) == pytest.approx(0.5, abs=0.01)
    assert latencies.percentile(99) == pytest.approx(0.99, abs=0.01)
