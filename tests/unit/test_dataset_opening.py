"""Going on with a data set: what is there already, what is refused, what is rebuilt."""

import fcntl
import json
import os
import re
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from holders import held
from reconstruction import Capture, capture_warnings, write_capture
from reconstruction.base.errors import InputError
from runs import PLAN, Run, rows, write_plan
from spisim.dataset.folder import Layout, Origin
from spisim.dataset.manifest import Manifest
from spisim.dataset.planned import PlannedSet, load_plan


@pytest.fixture
def planned(tmp_path: Path) -> PlannedSet:
    return write_plan(tmp_path, PLAN)


def own_capture(
    planned: PlannedSet, folder: Path, index: int, capture: Capture, *warnings: str
) -> Path:
    """A capture that says that it is a sample of the plan."""
    origin = Origin(planned.digest, index, {}, warnings)
    settings = yaml.safe_dump({"data_set": origin.settings})
    path = Layout(folder).capture(index)
    write_capture(replace(capture, provenance=replace(capture.provenance, settings=settings)), path)
    return path


def test_more_samples_extend_and_fewer_are_refused(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    Run(planned, folder)
    more = planned.with_samples(7)
    assert more.digest == planned.digest
    assert Run(more, folder).executor.asked == [[5, 6]]
    assert load_plan(folder / "plan.yaml").plan.size == 7
    with pytest.raises(InputError, match=r"set holds samples up to number 6, but the plan has"):
        Run(planned, folder)
    assert len(rows(folder, "status")) == 7


@pytest.mark.parametrize(
    ("old", "new", "displayed"),
    [
        ("name: some", "name: some\nseed: 5", ["+seed: 5"]),
        ("90.0", "80.0", ["-    - 90.0", "+    - 80.0"]),
    ],
)
def test_another_plan_is_refused_and_what_changed_shown(
    planned: PlannedSet, tmp_path: Path, old: str, new: str, displayed: list[str]
) -> None:
    Run(planned, tmp_path / "set")
    with pytest.raises(InputError, match="holds samples of another plan") as caught:
        Run(write_plan(tmp_path, PLAN.replace(old, new)), tmp_path / "set")
    for line in displayed:
        assert line in str(caught.value).splitlines()
    assert (tmp_path / "set" / "plan.yaml").read_text() == PLAN


def test_another_order_of_the_grids_is_another_plan(tmp_path: Path) -> None:
    grids = {"scene.fog.visibility_m": {"grid": [20, 50]}, "scene.fog.albedo": {"grid": [0.9, 1]}}
    fields = yaml.safe_load(PLAN)

    def ordered(names: list[str]) -> PlannedSet:
        vary = {name: grids[name] for name in names}
        return write_plan(tmp_path, yaml.safe_dump({**fields, "vary": vary}, sort_keys=False))

    Run(ordered([*grids]), tmp_path / "set")
    with pytest.raises(InputError, match="another plan") as caught:
        Run(ordered([*reversed(grids)]), tmp_path / "set")
    assert "+  scene.fog.albedo:" in str(caught.value).splitlines()
    (tmp_path / "set" / "plan.yaml").unlink()
    with pytest.raises(InputError, match="another plan; use another folder, or restore the plan"):
        Run(ordered([*reversed(grids)]), tmp_path / "set")


def test_samples_that_drew_integers_are_not_continued_with_real_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = write_plan(tmp_path, PLAN.replace("[20.0, 90.0]", "[20, 90]"))
    visibilities = {plan.sample(i).parameters["scene.fog.visibility_m"] for i in range(5)}
    assert not any(float(each).is_integer() for each in visibilities)
    with monkeypatch.context() as earlier:
        earlier.setattr("spisim.dataset.planned.has_integer_bounds", lambda _: False)
        Run(write_plan(tmp_path, plan.text), tmp_path / "set")
    with pytest.raises(InputError, match="draws real numbers now, or integers with integer: true"):
        Run(plan, tmp_path / "set")
    integers = plan.text.replace("[20, 90]", "[20, 90], integer: true")
    drawn = write_plan(tmp_path, integers).sample(0).parameters["scene.fog.visibility_m"]
    assert isinstance(drawn, int)


def test_another_scene_file_is_refused(tmp_path: Path) -> None:
    scene = tmp_path / "room.yaml"
    scene.write_text("name: room\n")
    text = PLAN.replace("{family: targets}", "{scene: room.yaml}")
    Run(write_plan(tmp_path, text), tmp_path / "set")
    scene.write_text("name: room  # another comment\n")
    Run(write_plan(tmp_path, text), tmp_path / "set")
    scene.write_text("name: hall\n")
    with pytest.raises(InputError, match=r"other files: scene room\.yaml; use another folder"):
        Run(write_plan(tmp_path, text), tmp_path / "set")


def test_a_folder_with_something_else_called_plan(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "plan.yaml").write_text("- a list")
    with pytest.raises(InputError, match=r"plan\.yaml: not the plan of a data set"):
        Run(planned, folder)


def test_two_runs_at_once(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    with held(folder / ".lock"):
        expected = "set: process 123 on there is writing into it; wait for it or end it"
        with pytest.raises(InputError, match=expected):
            Run(planned, folder)


def test_the_lock_of_a_dead_process_does_not_matter(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / ".lock").write_text(f"{os.getpid()} here\n")  # of a process that lives, but no run
    assert Run(planned, folder).state.done == 5


def test_a_lock_without_a_name_is_still_one(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    with (folder / ".lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="process unknown"):
            Run(planned, folder)


def test_a_capture_without_a_row_brings_its_warnings(
    planned: PlannedSet, tmp_path: Path, capture: Capture
) -> None:
    """A run that is killed between the two loses none."""
    folder = tmp_path / "set"
    own_capture(planned, folder, 0, capture, "too dark")
    Run(planned, folder)
    (found,) = (json.loads(row[0]) for row in rows(folder, "warnings")[:1])
    assert found == ["too dark", *capture_warnings(capture)]


DAMAGE = {
    "schema": "UPDATE meta SET value = '99' WHERE key = 'schema_version'",
    "meta": "DELETE FROM meta WHERE key = 'plan_digest'",
    "row": "UPDATE samples SET parameters = '{' WHERE \"index\" = 3",
}


@pytest.mark.parametrize("content", ["nonsense" * 100, "", *DAMAGE])
def test_a_damaged_manifest_is_kept_and_rebuilt(
    planned: PlannedSet, tmp_path: Path, capture: Capture, content: str
) -> None:
    folder = tmp_path / "set"
    Run(planned, folder)
    for index in range(4):
        own_capture(planned, folder, index, capture)
    Layout(folder).capture(4).unlink()
    manifest = folder / "manifest.sqlite"
    if content in DAMAGE:
        with closing(sqlite3.connect(manifest)) as connection, connection:
            connection.execute(DAMAGE[content])
    else:
        manifest.write_text(content)
    before = manifest.read_bytes()
    run = Run(planned, folder)
    assert run.executor.asked == [[4]]
    assert run.state.done == 5
    assert (folder / "manifest.damaged-1.sqlite").read_bytes() == before
    assert "moved to manifest.damaged-1.sqlite and rebuilt from the samples" in run.said[0]
    assert "found 4 samples that the manifest lacked" in run.said[1]
    expected = json.dumps(planned.sample(2).parameters)
    assert rows(folder, "status, scene, parameters")[2] == (
        "done",
        planned.sample(2).scene_name,
        expected,
    )
    assert Run(planned, folder).said == []


def test_a_capture_of_another_plan_is_named_and_kept(
    planned: PlannedSet, tmp_path: Path, capture: Capture
) -> None:
    folder = tmp_path / "set"
    other = write_plan(tmp_path, PLAN + "seed: 8\n")
    path = own_capture(other, folder, 1, capture)
    with pytest.raises(InputError, match=rf"{re.escape(str(path))}: in this data set's folder"):
        Run(planned, folder)
    assert path.exists()
    path.unlink()
    write_capture(capture, path)  # of no data set at all
    with pytest.raises(InputError, match="not part of it"):
        Run(planned, folder)


def test_a_capture_under_another_number_is_foreign(
    planned: PlannedSet, tmp_path: Path, capture: Capture
) -> None:
    folder = tmp_path / "set"
    path = own_capture(planned, folder, 1, capture)
    path.rename(path.with_name("000002.h5"))
    with pytest.raises(InputError, match=r"000002\.h5: in this data set's folder"):
        Run(planned, folder)


def test_a_damaged_capture_without_a_row_is_made_again(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    path = Layout(folder).capture(3)
    path.parent.mkdir(parents=True)
    path.write_bytes(b"\x89HDF")
    run = Run(planned, folder)
    assert run.state.done == 5
    assert run.said == [f"removed damaged captures, which are made again: {path}"]


@pytest.mark.parametrize("name", ["mine.h5", "000005.h5"])  # the plan ends with sample 4
def test_what_cannot_be_read_and_is_no_sample_is_kept(
    planned: PlannedSet, tmp_path: Path, name: str
) -> None:
    folder = tmp_path / "set"
    path = Layout(folder).capture(0).with_name(name)
    path.parent.mkdir(parents=True)
    path.write_bytes(b"somebody's own")
    with pytest.raises(InputError, match=rf"{name}: in this data set's folder"):
        Run(planned, folder)
    assert path.read_bytes() == b"somebody's own"


def test_fewer_samples_than_captures_without_a_manifest(
    planned: PlannedSet, tmp_path: Path, capture: Capture
) -> None:
    folder = tmp_path / "set"
    for index in range(4):
        own_capture(planned, folder, index, capture)
    with pytest.raises(InputError, match="up to number 3, but the plan has only 2"):
        Run(planned.with_samples(2), folder)
    assert Run(planned, folder).state.done == 5


def test_going_on_with_other_software_is_told(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    Run(planned, folder, {1: "fail"})
    with Manifest.open(folder / "manifest.sqlite") as manifest:
        software = manifest.meta["software"]
        manifest.note({"software": "spisim 0.0.1"})
    run = Run(planned, folder, retry_failed=True)
    assert run.said == [
        f"begun by spisim 0.0.1, continued by {software}; samples may differ between the two"
    ]
