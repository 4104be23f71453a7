"""Workers of a Dask cluster, here threads of this process."""

import socket
from pathlib import Path
from typing import Any

import pytest

from makers import Fake
from reconstruction.base.errors import InputError
from spisim.dataset import dask
from spisim.dataset.dask import SUBMITTED, DaskExecutor

distributed = pytest.importorskip("distributed")


def cluster(port: int, workers: int = 1) -> Any:
    """Scheduler at a port, and its workers."""
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        scheduler_port=port,
        dashboard_address=None,
    )


@pytest.fixture
def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def test_two_data_sets_on_one_cluster_do_not_mix(tmp_path: Path) -> None:
    indices = range(3)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        one, other = (Fake(tmp_path / name, seconds=0.1) for name in ("one", "other"))
        with DaskExecutor(one, address) as first, DaskExecutor(other, address) as second:
            pairs = list(zip(first.run(indices), second.run(indices), strict=True))
    assert {outcome.index for pair in pairs for outcome in pair} == set(indices)
    for name in ("one", "other"):
        assert len(list((tmp_path / name / "samples").rglob("*.h5"))) == 3


def test_a_scheduler_that_is_lost_is_waited_for(tmp_path: Path, port: int) -> None:
    said: list[str] = []
    make = Fake(tmp_path, seconds=0.05)
    first = cluster(port)
    address = first.scheduler_address
    with DaskExecutor(make, address, said.append) as executor:
        outcomes = executor.run(range(6))
        made = [next(outcomes)]
        first.close()
        with cluster(port):
            made += outcomes
    assert sorted(outcome.index for outcome in made) == list(range(6))
    assert all(outcome.done for outcome in made)
    gone, back = said
    assert gone == f"--dask {address}: the scheduler is gone; waiting for it"
    assert back.startswith(f"--dask {address}: the scheduler is back with ")


def test_a_scheduler_that_stays_away_is_named(
    tmp_path: Path, port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask, "ANSWER_S", 0.5)
    monkeypatch.setattr(dask, "PATIENCE_S", 0.0)
    first = cluster(port)
    with DaskExecutor(Fake(tmp_path, seconds=0.05), first.scheduler_address, print) as executor:
        outcomes = executor.run(range(6))
        next(outcomes)
        first.close()
        with pytest.raises(InputError, match="the scheduler is gone and did not return within 0 s"):
            list(outcomes)


def test_samples_of_a_lost_worker_go_to_another(tmp_path: Path, port: int) -> None:
    make = Fake(tmp_path, seconds=0.05)
    with (
        cluster(port, workers=2) as both,
        DaskExecutor(make, both.scheduler_address) as executor,
    ):
        outcomes = executor.run(range(8))
        made = [next(outcomes)]
        both.scale(1)
        made += outcomes
    assert sorted(outcome.index for outcome in made) == list(range(8))


def test_samples_of_a_world_go_to_one_worker_and_idle_ones_take_others() -> None:
    executor = object.__new__(DaskExecutor)
    executor._world_of = lambda index: 0
    workers = ["a", "b"]
    executor._workers = lambda: workers  # type: ignore[method-assign]
    (_, own), *rest = executor._following(range(8), [])
    other = "ab".replace(own, "")
    assert rest == [(1, own), (2, other)]
    assert SUBMITTED == 2
    assert list(executor._following([2, 3], [(0, own), (1, own)])) == [(2, other)]
    assert list(executor._following([2, 3], [(0, own)])) == [(2, own), (3, other)]
    assert list(executor._following([2, 3], [(0, own), (1, own), (4, other)])) == []
    workers.clear()
    assert list(executor._following([2, 3], [])) == [(2, None)]
    assert list(executor._following([2, 3], [(0, "gone")])) == []
