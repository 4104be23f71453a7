"""Running a data set: what is made, tried again, and waited for."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from makers import Fake, InThisProcess
from reconstruction.base.errors import InputError
from runs import PLAN, Run, rows, write_plan
from spisim.dataset import runner
from spisim.dataset.folder import Layout
from spisim.dataset.manifest import Manifest
from spisim.dataset.planned import PlannedSet
from spisim.dataset.records import Outcome
from spisim.dataset.runner import OutOfSpace, run_dataset


@pytest.fixture
def planned(tmp_path: Path) -> PlannedSet:
    return write_plan(tmp_path, PLAN)


def test_all_is_made_and_noted(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    run = Run(planned, folder)
    assert (run.state.done, run.state.failed, run.state.missing) == (5, 0, 0)
    assert [state.done for state in run.states] == [0, 1, 2, 3, 4, 5]
    assert run.states[2].fraction == 0.4
    assert (folder / "plan.yaml").read_text() == PLAN
    reported = rows(folder, '"index", status, scene, parameters, file, bytes, attempts, error')
    text = json.dumps({"x": 1})
    assert reported[1] == (1, "done", "scene 1", text, "samples/000/000001.h5", 8, 1, None)
    assert rows(folder, "sha256")[1] == (hashlib.sha256(b"sample 1").hexdigest(),)
    with Manifest.open(folder / "manifest.sqlite") as manifest:
        assert manifest.meta["schema_version"] == "1"
        assert manifest.meta["plan_digest"] == planned.digest
        assert manifest.meta["name"] == "some"


def test_a_second_run_makes_nothing(planned: PlannedSet, tmp_path: Path) -> None:
    Run(planned, tmp_path / "set")
    again = Run(planned, tmp_path / "set")
    assert again.executor.asked == []
    assert again.state.done == 5
    assert again.said == []


def test_failed_samples_stay_failed_unless_asked(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    assert Run(planned, folder, {3: "fail"}).state.failed == 1
    assert rows(folder, '"index", error, attempts')[3] == (3, "no luck", 1)
    assert Run(planned, folder).executor.asked == []
    again = Run(planned, folder, {3: "fail"}, retry_failed=True)
    assert again.executor.asked == [[3]]  # once, though it failed again
    assert Run(planned, folder, retry_failed=True).state.done == 5
    assert rows(folder, "error, attempts")[3] == (None, 3)


def test_a_sample_that_took_its_worker_with_it_is_tried_once_more(
    planned: PlannedSet, tmp_path: Path
) -> None:
    folder = tmp_path / "set"

    class Deadly(InThisProcess):
        def run(self, indices: object) -> Iterator[Outcome]:
            for outcome in super().run(indices):  # type: ignore[arg-type]
                if outcome.index == 2:
                    yield Outcome(2, "failed", error="worker killed by SIGKILL")
                else:
                    yield outcome

    executor = Deadly(Fake(folder))
    state = run_dataset(planned, folder, executor)
    assert executor.asked == [[0, 1, 2, 3, 4], [2]]
    assert (state.done, state.failed) == (4, 1)
    assert rows(folder, "error, attempts")[2] == ("worker killed by SIGKILL", 2)
    executor.asked.clear()
    run_dataset(planned, folder, executor)
    assert executor.asked == []  # not for ever


def test_lost_and_shortened_files_are_made_again(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    Run(planned, folder)
    Layout(folder).capture(1).unlink()
    Layout(folder).capture(4).write_text("short")
    again = Run(planned, folder)
    assert again.executor.asked == [[1, 4]]
    assert "remaking 2 samples with missing or damaged files: 1, 4" in again.said


def test_leftovers_are_removed(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    Run(planned, folder)
    left = [folder / "samples/000/.000003.h5.0a1b2c3d.tmp", folder / ".probe.0a1b2c3d.tmp"]
    for path in left:
        path.touch()
    Run(planned, folder)
    assert not any(path.exists() for path in left)


def test_no_space_is_waited_out(
    planned: PlannedSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter([False, False, True])
    monkeypatch.setattr(runner, "has_space", lambda folder: next(answers))
    monkeypatch.setattr(runner, "SPACE_CHECK_S", 0.01)
    folder = tmp_path / "set"
    run = Run(planned, folder, {1: "no space once"})
    assert run.executor.asked == [[0, 1, 2, 3, 4], [1]]
    assert run.state.done == 5
    assert run.said == [
        f"{folder}: no space left; waiting",
        "Space is available again; continuing",
    ]
    assert rows(folder, "attempts")[1] == (1,)  # waiting is no attempt


def test_a_failed_sample_tried_again_is_not_lost_over_a_full_disk(
    planned: PlannedSet, tmp_path: Path
) -> None:
    folder = tmp_path / "set"
    Run(planned, folder, {1: "fail"})
    run = Run(planned, folder, {1: "no space once"}, retry_failed=True)
    assert run.executor.asked == [[1], [1]]
    assert run.state.done == 5


def test_no_space_for_too_long_ends_the_run(
    planned: PlannedSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "has_space", lambda folder: False)
    monkeypatch.setattr(runner, "SPACE_CHECK_S", 0.01)
    with pytest.raises(OutOfSpace, match=r"no space left for 0\.05 s; free some and run"):
        Run(planned, tmp_path / "set", {1: "no space"}, space_timeout_s=0.05)
    assert Run(planned, tmp_path / "set").state.done == 5


def test_samples_that_never_fit_end_the_run(planned: PlannedSet, tmp_path: Path) -> None:
    with pytest.raises(OutOfSpace, match="samples need more space"):
        Run(planned, tmp_path / "set", {1: "no space"})


def test_a_manifest_without_space_waits_too(
    planned: PlannedSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = iter([False, True])
    monkeypatch.setattr(runner, "has_space", lambda folder: next(answers))
    monkeypatch.setattr(runner, "SPACE_CHECK_S", 0.01)
    record, full = Manifest.record, iter([True])

    def sometimes_full(manifest: Manifest, outcome: Outcome) -> None:
        if next(full, False):
            raise OSError(28, "database or disk is full")
        record(manifest, outcome)

    monkeypatch.setattr(Manifest, "record", sometimes_full)
    assert Run(planned, tmp_path / "set").state.done == 5


def test_a_full_database_is_an_error_of_the_disk(tmp_path: Path) -> None:
    with Manifest.create(tmp_path / "m.sqlite", {}) as manifest:
        manifest._connection.execute("PRAGMA max_page_count = 6")
        with pytest.raises(OSError, match="full") as caught:
            manifest.record(Outcome(0, "failed", error="long " * 10_000))
        assert caught.value.errno == 28
        manifest.record(Outcome(0, "failed", error="short"))
        assert manifest.failures() == {0: "short"}


def test_files_of_workers_that_write_elsewhere(planned: PlannedSet, tmp_path: Path) -> None:
    executor = InThisProcess(Fake(tmp_path / "elsewhere"))
    with pytest.raises(InputError, match="all workers must share this folder"):
        run_dataset(planned, tmp_path / "set", executor)


def test_a_file_in_place_of_the_folder(planned: PlannedSet, tmp_path: Path) -> None:
    (tmp_path / "set").write_text("")
    with pytest.raises(InputError, match="set is not a folder"):
        Run(planned, tmp_path / "set")
