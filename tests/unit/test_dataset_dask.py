"""Workers of a Dask cluster, here threads of this process."""

from pathlib import Path

import pytest

from makers import Fake
from spisim.dataset.dask import DaskExecutor

distributed = pytest.importorskip("distributed")


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
