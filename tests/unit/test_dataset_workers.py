"""Processes that make samples: what one that dies, hangs or grows costs."""

import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from makers import Fake, Hoarder
from spisim.dataset import workers
from spisim.dataset.records import Outcome
from spisim.dataset.workers import LocalExecutor, default_workers
from waiting import SAFETY_S, until

linux = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


def outcomes(make: Fake, indices: range, count: int = 2) -> list[Outcome]:
    with LocalExecutor(make, count, SAFETY_S) as executor:
        return sorted(executor.run(indices), key=lambda outcome: outcome.index)


def test_every_sample_once_by_so_many_processes(tmp_path: Path) -> None:
    make = Fake(tmp_path, seconds=0.05)
    made = outcomes(make, range(7))
    assert [outcome.index for outcome in made] == list(range(7))
    assert all(outcome.done for outcome in made)
    assert len(make.pids()) == 2
    assert os.getpid() not in make.pids()
    for pid in make.pids():  # gone with the executor
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_process_goes_on_with_the_world_that_it_is_in(tmp_path: Path) -> None:
    make = Fake(tmp_path)
    with LocalExecutor(make, 1, SAFETY_S, lambda index: index // 4) as executor:
        made = [outcome.index for outcome in executor.run([0, 4, 1, 5, 2, 6, 3, 7])]
    assert made == [0, 1, 2, 3, 4, 5, 6, 7]


def test_another_process_begins_with_another_world(tmp_path: Path) -> None:
    make = Fake(tmp_path)
    with LocalExecutor(make, 2, SAFETY_S, lambda index: index // 4) as executor:
        made = [outcome.index for outcome in executor.run(range(8))]
    assert sorted(made) == list(range(8))
    names = (path.name.partition("-") for path in (tmp_path / "pids").glob("*-*"))
    makers = {int(index): pid for index, _, pid in names}
    assert makers[0] != makers[4]


def test_a_worker_that_dies_costs_its_sample_only(tmp_path: Path) -> None:
    make = Fake(tmp_path, {2: "kill", 4: "exit"})
    made = outcomes(make, range(6), count=1)
    assert [outcome.index for outcome in made if outcome.done] == [0, 1, 3, 5]
    assert made[2].error == "worker killed by SIGKILL"
    assert made[4].error == "worker ended with exit status 7"
    assert len(make.pids()) == 3


def test_one_that_hangs_is_ended(tmp_path: Path) -> None:
    make = Fake(tmp_path, {0: "hang"})
    with LocalExecutor(make, 2, SAFETY_S) as executor:
        made = executor.run(range(4))
        meanwhile = [next(made).index for _ in range(3)]  # by the other process
        assert meanwhile == [1, 2, 3]
        executor.timeout_s = 0.01
        (hung,) = made
        assert not hung.done
        assert hung.error == "took longer than 0.01 s"
        executor.timeout_s = SAFETY_S
        assert all(outcome.done for outcome in executor.run([5, 6]))


@linux
def test_one_that_grows_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "MAX_GROWTH_MB", 100)
    make = Hoarder(tmp_path)
    made = outcomes(make, range(6), count=1)
    assert all(outcome.done for outcome in made)
    # 60 MB a sample: 100 MB above the first are passed with the third.
    assert len(make.pids()) == 2


def test_one_is_replaced_after_many_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "MAX_SAMPLES", 2)
    make = Fake(tmp_path)
    outcomes(make, range(3), count=1)
    assert len(make.pids()) == 2


def test_one_that_died_while_idle_is_no_loss(tmp_path: Path) -> None:
    make = Fake(tmp_path)
    with LocalExecutor(make, 1) as executor:
        assert len(list(executor.run(range(2)))) == 2
        (worker,) = (w for w in multiprocessing.active_children() if w.pid in make.pids())
        worker.kill()
        worker.join()
        assert [outcome.done for outcome in executor.run([2, 3])] == [True, True]


@linux
def test_they_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    """Which may be a script that does not look whether it is the main module."""
    code = f"""
        from pathlib import Path
        from makers import Fake
        from spisim.dataset.workers import LocalExecutor
        make = Fake(Path({str(tmp_path)!r}), {{0: "hang", 1: "hang"}})
        list(LocalExecutor(make, 2).run(range(2)))
    """
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(code))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = subprocess.Popen([sys.executable, script], env=environment, text=True)
    make = Fake(tmp_path)
    try:
        until(lambda: len(make.pids()) == 2, process)
        process.kill()
        process.wait()
        until(lambda: not any(map(alive, make.pids())))
    finally:
        for pid in filter(alive, [process.pid, *make.pids()]):
            os.kill(pid, signal.SIGKILL)


def test_they_end_in_silence_where_nobody_reads_what_they_made(tmp_path: Path) -> None:
    """A socket that is closed with something unread is reset, rather than at its end."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=workers._serve, args=(theirs, Fake(tmp_path)))
    with workers._without_main():
        process.start()
    theirs.close()
    ours.send(0)
    assert ours.poll(SAFETY_S)
    ours.close()
    process.join(SAFETY_S)
    assert process.exitcode == 0


def test_the_default_is_one_for_each_core_at_most() -> None:
    assert 1 <= default_workers() <= (os.cpu_count() or 1)


def test_it_is_fewer_where_there_is_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "WORKER_MEMORY_MB", 10**9)
    assert default_workers() == 1


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"
