"""Data sets from outside: processes are killed and disks run full, and the bytes stay the same."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from commands import program
from reconstruction import read_capture
from spisim.dataset import preview
from spisim.dataset.cost import Cost, Group, GroupCost
from spisim.dataset.planned import PlannedSet, load_plan
from spisim.dataset.preview import Preview
from spisim_app.cli import app
from tinysets import SAMPLES, captures, children, files, run, started, write_plan
from waiting import SAFETY_S, until

linux = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


def rows(folder: Path, columns: str = '"index", status, error, attempts') -> list[Any]:
    with closing(sqlite3.connect(folder / "manifest.sqlite")) as connection:
        return connection.execute(f'SELECT {columns} FROM samples ORDER BY "index"').fetchall()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A plan, and its data set as it comes out of an undisturbed run."""
    folder = tmp_path_factory.mktemp("whole")
    plan = write_plan(folder)
    done = run(plan, "-o", folder / "set", "--workers", "1", "--json")
    assert done.exit_code == 0, done.stderr
    fields = json.loads(done.stdout)
    assert (fields["samples"], fields["done"], fields["failed"]) == (SAMPLES, SAMPLES, 0)
    return plan, folder / "set"


def test_the_captures_tell_where_they_belong(whole: tuple[Path, Path]) -> None:
    plan, folder = whole
    assert captures(folder) == SAMPLES
    assert len(files(folder)) == 3 * SAMPLES
    capture = read_capture(folder / "samples" / "000" / "000004.h5")
    reported = yaml.safe_load(capture.provenance.settings)["data_set"]
    with closing(sqlite3.connect(folder / "manifest.sqlite")) as connection:
        meta = dict(connection.execute("SELECT key, value FROM meta"))
    assert (reported["plan"], reported["index"]) == (meta["plan_digest"], 4)
    assert set(reported["sidecars"]) == {".exr", ".npz"}
    assert capture.provenance.created == ""
    assert capture.plan.shape == (16, 16)
    assert capture.truth is not None
    assert (folder / "plan.yaml").read_text() == plan.read_text()
    columns = "parameters, sha256, sidecars, seconds, stage_seconds, peak_memory_mb, bytes"
    parameters, sha256, sidecars, seconds, stages, peak, size = rows(folder, columns)[4]
    visibility = json.loads(parameters)["scene.fog.visibility_m"]
    assert yaml.safe_load(capture.provenance.scene)["fog"]["visibility_m"] == visibility
    result = files(folder)
    assert result["samples/000/000004.h5"] == sha256
    for name, beside in json.loads(sidecars).items():
        assert result[name] == beside["sha256"] == reported["sidecars"][Path(name).suffix]
    assert seconds > sum(json.loads(stages).values()) * 0.99 > 0
    assert 50 < peak < 2000
    assert size == (folder / "samples/000/000004.h5").stat().st_size


@pytest.mark.slow
def test_one_worker_and_another_order_make_the_same(
    whole: tuple[Path, Path], tmp_path: Path
) -> None:
    plan, folder = whole
    assert run(plan, "-o", tmp_path / "set", "--workers", "1", "--samples", "3").exit_code == 0
    same = files(tmp_path / "set")
    assert len(same) == 9
    assert same.items() <= files(folder).items()


@linux
def test_a_main_process_that_is_killed(whole: tuple[Path, Path], tmp_path: Path) -> None:
    plan, folder = whole
    with started(plan, "-o", tmp_path / "set", "--workers", "2") as process:
        until(lambda: captures(tmp_path / "set") >= 1, process)
        workers = children(process.pid)
        process.kill()  # its workers have to end by themselves
        process.wait()
        until(lambda: not any(Path(f"/proc/{pid}/exe").exists() for pid in workers))
    left = captures(tmp_path / "set")
    assert 1 <= left < SAMPLES
    assert run(plan, "-o", tmp_path / "set", "--workers", "1").exit_code == 0
    assert files(tmp_path / "set") == files(folder)
    assert [row[1] for row in rows(tmp_path / "set")] == ["done"] * SAMPLES


@linux
@pytest.mark.slow
def test_a_worker_that_is_killed(whole: tuple[Path, Path], tmp_path: Path) -> None:
    plan, folder = whole
    with started(plan, "-o", tmp_path / "set", "--workers", "2") as process:
        until(lambda: captures(tmp_path / "set") >= 1, process)
        os.kill(children(process.pid)[0], signal.SIGKILL)
        assert process.wait(SAFETY_S) == 0
    assert files(tmp_path / "set") == files(folder)
    reported = rows(tmp_path / "set")
    assert [row[1] for row in reported] == ["done"] * SAMPLES
    assert sorted(row[3] for row in reported) == [1] * (SAMPLES - 1) + [2]  # one twice


@linux
@pytest.mark.slow
def test_ctrl_c(whole: tuple[Path, Path], tmp_path: Path) -> None:
    plan, folder = whole
    with started(plan, "-o", tmp_path / "set", "--workers", "2") as process:
        until(lambda: captures(tmp_path / "set") >= 1, process)
        workers = children(process.pid)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to all of them
        message = process.communicate(timeout=SAFETY_S)[1]
        assert process.returncode == 130
        assert "Run the same command again to continue" in message
        assert "Traceback" not in message
        assert not any(Path(f"/proc/{pid}/exe").exists() for pid in workers)
    assert not [name for name in files(tmp_path / "set") if name.endswith(".tmp")]
    assert run(plan, "-o", tmp_path / "set").exit_code == 0
    assert files(tmp_path / "set") == files(folder)


@pytest.mark.usefixtures("no_workers")
def test_one_sample_that_cannot_be_made(tmp_path: Path) -> None:
    # In sample 1 of this seed the drone is inside a block.
    block = {"name": "block", "shape": "box", "size_m": [1, 1, 1], "material": "brick"}
    around = {"choice": [[], [{**block, "translate_m": [0, 0, 1.5]}]], "weights": [2, 1]}
    drone = {"scene.drone.position_m": [0, 0, 1.5], "scene.drone.look_at_m": [9, 0, 1.5]}
    vary = {"scene.objects": around, **drone}
    plan = write_plan(tmp_path, samples=3, seed=5, vary=vary)
    done = run(plan, "-o", tmp_path / "set", "--workers", "1", "--json")
    assert done.exit_code == 1, done.stderr
    fields = json.loads(done.stdout)
    assert (fields["done"], fields["failed"]) == (2, 1)
    reason = fields["failures"]["1"]
    assert "is inside object 'block'" in reason
    assert "\n" not in reason
    assert "Traceback" in (tmp_path / "set/errors/000001.txt").read_text()
    again = run(plan, "-o", tmp_path / "set", "--workers", "1", "--retry-failed")
    assert again.exit_code == 1
    assert rows(tmp_path / "set")[1] == (1, "failed", reason, 2)
    assert f"sample 1 failed: {reason}" in again.stderr


FULL = """
    set -e
    mount -t tmpfs -o size=12m none {disk}
    head -c 12200000 /dev/zero > {disk}/ballast
    {command} &
    run=$!
    trap "kill $run 2> /dev/null || true" EXIT
    while kill -0 $run && ! grep -q "no space left" {log}; do sleep 0.1; done
    ls {disk}/set/samples/*/*.h5 > {before}
    {relief}
    status=0
    wait $run || status=$?
    cp -r {disk}/set {after}
    exit $status
"""


def on_a_full_disk(plan: Path, folder: Path, relief: str, *options: str) -> tuple[int, str]:
    """Exit status and messages of a run on a disk of its own that is full but for 0.4 MB."""
    disk, log = folder / "disk", folder / "log"
    disk.mkdir()
    log.touch()
    if (
        shutil.which("unshare") is None
        or subprocess.run(
            ["unshare", "--map-root-user", "--mount", "mount", "-t", "tmpfs", "none", disk],
            capture_output=True,
            check=False,
        ).returncode
    ):
        pytest.skip("no disk of one's own can be mounted here")
    command = program("dataset", plan, "-o", disk / "set", "--workers", "2", *options)
    script = textwrap.dedent(FULL).format(
        disk=disk,
        command=" ".join(f"'{word}'" for word in command) + f" 2> {log}",
        log=log,
        before=folder / "before",
        after=folder / "after",
        relief=relief.format(disk=disk),
    )
    done = subprocess.run(
        ["unshare", "--map-root-user", "--mount", "sh", "-c", script],
        capture_output=True,
        text=True,
        timeout=SAFETY_S,
        check=False,
    )
    return done.returncode, log.read_text() + done.stderr


@pytest.mark.slow
def test_a_full_disk_is_waited_for(tmp_path: Path) -> None:
    keep = {"histograms": True}
    plan = write_plan(tmp_path, samples=10, keep=keep)
    assert run(plan, "-o", tmp_path / "whole", "--workers", "2").exit_code == 0
    status, said = on_a_full_disk(plan, tmp_path, "rm {disk}/ballast")
    assert status == 0, said
    assert "Space is available again; continuing" in said
    assert 0 < len((tmp_path / "before").read_text().splitlines()) < 10
    assert not list((tmp_path / "after").rglob("*.tmp"))
    assert files(tmp_path / "after") == files(tmp_path / "whole")
    assert [row[1] for row in rows(tmp_path / "after")] == ["done"] * 10


@pytest.mark.slow
def test_a_disk_that_stays_full_ends_the_run(tmp_path: Path) -> None:
    plan = write_plan(tmp_path, samples=10, keep={"histograms": True})
    status, said = on_a_full_disk(plan, tmp_path, ":", "--space-timeout", "1")
    assert status == 3
    assert "no space left for 1 s; free some and run the same command again" in said
    assert "Traceback" not in said
    assert not list((tmp_path / "after").rglob("*.tmp"))
    done = rows(tmp_path / "after", "file, sha256")
    assert 0 < len(done) < 10
    assert run(plan, "-o", tmp_path / "after", "--workers", "2").exit_code == 0
    result = files(tmp_path / "after")
    assert all(result[name] == sha256 for name, sha256 in done)


CLUSTER = """
    import sys
    from distributed import LocalCluster
    if __name__ == "__main__":
        with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
            print(cluster.scheduler_address, flush=True)
            print(*(nanny.pid for nanny in cluster.workers.values()), flush=True)
            sys.stdin.read()
"""


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[int]]]:
    """Address of a Dask cluster of two workers on this machine, and their processes."""
    script = folder / "cluster.py"
    script.write_text(textwrap.dedent(CLUSTER))
    process = subprocess.Popen(
        [sys.executable, script],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        env=os.environ | {"PYTHONPATH": str(Path(preview.__file__).parents[2])},
    )
    assert process.stdout is not None
    try:
        address = process.stdout.readline().strip()
        yield address, [int(pid) for pid in process.stdout.readline().split()]
        process.communicate("", timeout=SAFETY_S)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker(whole: tuple[Path, Path], tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    plan, folder = whole
    with (
        cluster(tmp_path) as (address, pids),
        started(plan, "-o", tmp_path / "set", "--dask", address) as process,
    ):
        until(lambda: captures(tmp_path / "set") >= 1, process)
        os.kill(pids[0], signal.SIGKILL)
        assert process.wait(SAFETY_S) == 0
    assert files(tmp_path / "set") == files(folder)
    assert [row[1] for row in rows(tmp_path / "set")] == ["done"] * SAMPLES


def test_a_scheduler_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("spisim.dataset.dask.ANSWER_S", 0.5)
    done = run(write_plan(tmp_path), "-o", tmp_path / "set", "--dask", "tcp://127.0.0.1:9")
    assert done.exit_code == 2
    assert "--dask tcp://127.0.0.1:9: no scheduler answers there" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "set").exists()


@pytest.mark.slow
def test_the_dry_run_tells_what_it_would_cost(whole: tuple[Path, Path]) -> None:
    plan, folder = whole
    done = run(plan, "--dry-run", "--json", "--workers", "2", "--samples", "100")
    assert done.exit_code == 0, done.stderr
    fields = json.loads(done.stdout)
    assert fields["samples"] == 100
    sizes = [path.stat().st_size for path in (folder / "samples").rglob("*.*")]
    assert fields["bytes"] / 100 == pytest.approx(sum(sizes) / SAMPLES, rel=0.1)
    assert fields["seconds"] == pytest.approx(fields["cost"]["mean_s"] * 100 / 2)
    assert fields["cost"]["samples"] == 12
    assert len(fields["first"]) == 10
    first = json.loads(rows(folder, "parameters")[0][0])
    assert fields["first"][0]["parameters"] == first


def test_the_dry_run_lists_what_differs_and_costs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def estimated(planned: PlannedSet, folder: Path, *others: object, **more: object) -> Preview:
        assert not any(folder.iterdir())
        displayed = [planned.sample(index) for index in range(2)]
        costs = [
            GroupCost(Group("targets", "fog"), 0.75, Cost(4, 1.5, 2.5, 3.5, 2.0)),
            GroupCost(Group("targets", "clear"), 0.25, None),
        ]
        cost, failures = Cost(4, 1.5, 2.5, 3.5, 2.0), {5: "no luck"}
        return Preview(SAMPLES, displayed, costs, cost, 30.0, 20_000, failures, workers=2)

    monkeypatch.setattr(preview, "preview", estimated)
    plan = write_plan(tmp_path)
    done = CliRunner().invoke(app, ["dataset", str(plan), "--dry-run", "--workers", "2"])
    assert done.exit_code == 0, done.output
    listed, _, table = done.stdout.partition("\n\n")
    common, first, second, rest = listed.splitlines()
    _, fog, clear, every, cost, compiling = table.splitlines()
    assert fog.split() == ["targets", "fog", "75%", "4", "1.50", "2.50", "3.50"]
    assert clear.split() == ["targets", "clear", "25%", "0"]
    assert every.split() == ["all", "100%", "4", "1.50", "2.50", "3.50"]
    assert "compiled kernels for 30 s" in compiling
    assert "sample 5 failed: no luck" in done.stderr
    assert common.startswith("   all  scene: targets, ")
    assert "instrument.projector.shape: [16, 16], instrument.plan.patterns: 32" in common
    for index, line in enumerate((first, second)):
        sample = load_plan(plan).sample(index)
        visibility_m = sample.parameters["scene.fog.visibility_m"]
        assert line.startswith(f"{index:6}  {sample.scene_name}  family_seed: ")
        assert line.endswith(f", scene.fog.visibility_m: {visibility_m:.4g}")
        assert "patterns" not in line
    assert rest.endswith("and 4 more")
    assert cost == "6 samples, 0.12 MB, about 6 s with 2 workers (on average 2 s and 20 kB)"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["-o", "/proc/set"], "/proc/set"),
        (["-o", "tiny.yaml"], "tiny.yaml is not a folder"),
        ([], "--output DIR is missing"),
        (["-o", "set", "--workers", "0"], "0 is not a whole number from 1"),
        (["-o", "set", "--workers", "2", "--dask", "tcp://127.0.0.1:1"], "exclude each other"),
    ],
)
def test_mistakes_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    plan = write_plan(tmp_path)
    done = CliRunner().invoke(app, ["dataset", str(plan), *arguments])
    assert done.exit_code == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["tiny.yaml"]
