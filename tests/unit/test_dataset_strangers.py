"""Data sets of strangers: nothing outside their folder is read, written or removed."""

import os
import shutil
import sqlite3
import struct
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

import spisim.dataset
from commands import mistake
from datasets import change, make_set, put_captures
from reconstruction import Capture, InputError, write_capture
from reconstruction.base.folders import holder, locked_folder
from runs import PLAN, Run, rows, write_plan
from spisim.dataset import verify
from spisim.dataset.folder import Layout, has_its_content, origin_of
from spisim.dataset.manifest import DamagedManifest, Manifest, read_manifest
from spisim.dataset.planned import PlannedSet
from spisim.dataset.runner import has_space
from spisim.dataset.status import status_of
from spisim_app.report.facts import media_of
from spisim_formats.samples.webdataset import write_shards


@pytest.fixture(scope="module")
def folder(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_set(tmp_path_factory.mktemp("sets") / "walls", capture, done=3, failed=1)


@pytest.fixture
def own(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "walls"))


@pytest.fixture
def planned(tmp_path: Path) -> PlannedSet:
    return write_plan(tmp_path, PLAN)


@pytest.fixture
def key(tmp_path: Path) -> Path:
    """A file of the user's, outside of every data set."""
    path = tmp_path / "id_rsa"
    path.write_text("-----BEGIN KEY-----\n")
    return path


def contents(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


REPORTED = '{"bytes": 1, "sha256": "' + "0" * 64 + '"}'
ROWS = {
    "a sidecar elsewhere": f"""UPDATE samples SET sidecars = '{{"../id_rsa": {REPORTED}}}'""",
    "a sidecar by its whole path": f"""UPDATE samples SET
        sidecars = '{{"/etc/passwd": {REPORTED}}}'""",
    "a sidecar of another sample": f"""UPDATE samples SET sidecars =
        '{{"samples/000/000002.npz": {REPORTED}}}' WHERE "index" = 0""",
    "a sidecar of another kind": f"""UPDATE samples SET sidecars =
        '{{"samples/000/000000.txt": {REPORTED}}}' WHERE "index" = 0""",
    "a sidecar without a size": """UPDATE samples SET sidecars =
        '{"samples/000/000000.npz": {}}' WHERE "index" = 0""",
    "sidecars as a list": "UPDATE samples SET sidecars = '[1]'",
    "a capture elsewhere": "UPDATE samples SET file = '../id_rsa.h5'",
    "a capture on a detour": "UPDATE samples SET file = 'samples/../samples/000/000000.h5'",
    "no capture": "UPDATE samples SET file = NULL WHERE status = 'done'",
    "a capture of a failed sample": "UPDATE samples SET file = 'samples/000/000003.h5'",
    "a number beyond the samples": 'UPDATE samples SET "index" = 99 WHERE "index" = 0',
    "a number below 0": 'UPDATE samples SET "index" = -1 WHERE "index" = 0',
    "no SHA-256": "UPDATE samples SET sha256 = 'short'",
    "a size that is none": "UPDATE samples SET bytes = -1",
    "words for a number": "UPDATE samples SET seconds = 'long'",
    "infinite time": "UPDATE samples SET seconds = 9e999",
    "bytes for words": "UPDATE samples SET scene = x'ff00'",
    "words that are none": "UPDATE samples SET scene = CAST(x'ff00' AS TEXT)",
    "no time": "UPDATE samples SET finished = 'yesterday'",
    "a time of nowhere": "UPDATE samples SET finished = '2026-01-01T00:00:00'",
    "the year 1": "UPDATE samples SET finished = '0001-01-01T00:00:00+00:00'",
    "deep parameters": f"UPDATE samples SET parameters = '{'[' * 10**5}{']' * 10**5}'",
    "deep sections": f"""UPDATE samples SET parameters = '{'{"a":' * 10**5}1{"}" * 10**5}'""",
    "a number of many digits": f"""UPDATE samples SET parameters = '{{"a": {"9" * 400}}}'""",
    "a very long value": "UPDATE samples SET error = printf('%.*c', 9000000, 'x')",
    "warnings that are none": "UPDATE samples SET warnings = '[[]]'",
    "no samples": "UPDATE meta SET value = '0' WHERE key = 'samples'",
    "too many samples": "UPDATE meta SET value = '1e9' WHERE key = 'samples'",
    "files that are none": f"UPDATE meta SET value = '{'[' * 10**5}' WHERE key = 'files'",
}


@pytest.mark.parametrize("statement", ROWS.values(), ids=ROWS)
def test_rows_that_no_run_writes_are_refused(own: Path, key: Path, statement: str) -> None:
    change(own, statement)
    for use in (spisim.dataset.open, verify, status_of):
        with pytest.raises(InputError, match=r"manifest\.sqlite: not a manifest of this version"):
            use(own)
    with pytest.raises(DamagedManifest) as caught:
        Manifest.open(own / "manifest.sqlite")
    assert len(str(caught.value)) < 400


TABLES = {
    "a view without end": """
        DROP TABLE samples; CREATE VIEW samples AS
        WITH RECURSIVE n(x) AS (SELECT 0 UNION ALL SELECT x + 1 FROM n) SELECT x FROM n""",
    "a trigger": """CREATE TRIGGER t AFTER INSERT ON samples
        BEGIN UPDATE samples SET file = '../id_rsa'; END""",
    "another table": "CREATE TABLE more (x)",
    "an index": "CREATE INDEX i ON samples (abs(attempts))",
    "another column": "ALTER TABLE samples ADD COLUMN more TEXT",
    "a computed column": """
        ALTER TABLE samples RENAME TO old; CREATE TABLE samples AS SELECT * FROM old;
        DROP TABLE old""",
}


@pytest.mark.parametrize("script", TABLES.values(), ids=TABLES)
def test_other_tables_are_refused(own: Path, script: str) -> None:
    with closing(sqlite3.connect(own / "manifest.sqlite")) as connection:
        connection.executescript(script)
    with pytest.raises(InputError, match="its tables are not those of a manifest"):
        read_manifest(own)
    with pytest.raises(DamagedManifest, match="its tables are not those of a manifest"):
        Manifest.open(own / "manifest.sqlite")


def journal_of(database: Path, other: Path) -> None:
    """Beside a database, a journal that names another file as its super-journal."""
    magic, page = bytes.fromhex("d9d505f920a163d7"), database.read_bytes()[:4096]
    pages, name = database.stat().st_size // 4096, str(other).encode()
    head = (magic + struct.pack(">5I", 1, 0, pages, 512, 4096)).ljust(512, b"\0")
    checksum = sum(page[position] for position in range(4096 - 200, 0, -200))
    record = struct.pack(">I", 1) + page + struct.pack(">I", checksum)
    tail = struct.pack(">I", 2**30 // 4096 + 1) + name + struct.pack(">2I", len(name), sum(name))
    journal = database.with_name(f"{database.name}-journal")
    journal.write_bytes(head + record + tail + magic)


def test_a_journal_cannot_have_a_file_removed(
    planned: PlannedSet, tmp_path: Path, key: Path
) -> None:
    folder = tmp_path / "set"
    Run(planned, folder)
    journal_of(folder / "manifest.sqlite", key)
    with pytest.raises(InputError, match="its journal names another file"):
        read_manifest(folder)
    said = Run(planned, folder).said
    assert "moved to manifest.damaged-1.sqlite" in said[0]
    assert key.exists()
    assert (folder / "manifest.damaged-1.sqlite-journal").exists()


@pytest.mark.parametrize("ending", ["-wal", "-shm"])
def test_a_log_beside_the_manifest_is_not_taken_up(own: Path, ending: str) -> None:
    (own / f"manifest.sqlite{ending}").write_bytes(b"")
    with pytest.raises(InputError, match="a write-ahead log lies beside it"):
        read_manifest(own)


def test_a_manifest_with_a_log_is_refused(own: Path) -> None:
    with closing(sqlite3.connect(own / "manifest.sqlite")) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
    with pytest.raises(InputError, match="it uses a write-ahead log"):
        read_manifest(own)


def link(path: Path, target: Path) -> None:
    """Put a link in place of a file or folder, whose content moves to the target."""
    if path.exists():
        path.rename(target)
    path.symlink_to(target)


@pytest.mark.parametrize("name", ["samples/000/000001.h5", "samples/000/000001.npz",
                                  "samples/000", "samples"])  # fmt: skip
def test_links_are_not_followed(own: Path, tmp_path: Path, name: str) -> None:
    link(own / name, tmp_path / "elsewhere")
    data = spisim.dataset.open(own)
    with pytest.raises(InputError, match=rf"{name} is a link; for safety"):
        data[1]
    with pytest.raises(InputError, match="is a link"):
        write_shards(data, tmp_path / "shards")
    with pytest.raises(InputError, match="is a link"):
        data.arrays("buckets")
    assert not (tmp_path / "shards").exists()
    assert [(f.file, f.problem, f.detail) for f in verify(own)] == [
        (name, "link", f"to {tmp_path / 'elsewhere'}")
    ]
    assert status_of(own).done == 3


def test_a_manifest_behind_a_link_is_refused(own: Path, tmp_path: Path) -> None:
    link(own / "manifest.sqlite", tmp_path / "elsewhere")
    with pytest.raises(InputError, match=r"manifest\.sqlite is a link"):
        read_manifest(own)


@pytest.mark.parametrize(
    "name", ["samples", "samples/000", "samples/000/000001.h5", "errors", "metrics", "plan.yaml",
             "manifest.sqlite", "manifest.sqlite-journal", ".lock"],
)  # fmt: skip
def test_a_run_does_not_write_through_links(planned: PlannedSet, tmp_path: Path, name: str) -> None:
    folder, target = tmp_path / "set", tmp_path / "target"
    Run(planned, folder)
    target.mkdir()
    (target / "000000.txt").write_text("mine")
    if (folder / name).is_dir():
        shutil.rmtree(folder / name)
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(target)
    before = contents(tmp_path)
    with pytest.raises(InputError, match="is a link"):
        Run(planned, folder)
    assert contents(tmp_path) == before


def test_a_lock_does_not_write_through_links(tmp_path: Path, key: Path) -> None:
    lock = tmp_path / "set" / ".lock"
    lock.parent.mkdir()
    lock.symlink_to(key)
    with pytest.raises(InputError, match=r"\.lock is a link"), locked_folder(lock.parent):
        pass
    with pytest.raises(InputError, match=r"\.lock is a link"):
        holder(lock)
    lock.unlink()
    lock.hardlink_to(key)
    with (
        pytest.raises(InputError, match=r"\.lock is not a lock of spisim"),
        locked_folder(lock.parent),
    ):
        pass
    assert key.read_text() == "-----BEGIN KEY-----\n"


def test_a_pipe_is_no_lock_and_no_capture(own: Path) -> None:
    os.mkfifo(own / ".lock")
    with pytest.raises(InputError, match=r"\.lock is not a regular file"), locked_folder(own):
        pass
    (own / "samples/000/000001.h5").unlink()
    os.mkfifo(own / "samples/000/000001.h5")
    with pytest.raises(InputError, match=r"000001\.h5 is not a regular file"):
        list(spisim.dataset.open(own))
    assert [(f.file, f.problem) for f in verify(own)] == [("samples/000/000001.h5", "missing")]


def test_space_is_tried_with_a_file_of_its_own(tmp_path: Path, key: Path) -> None:
    (tmp_path / ".space.tmp").symlink_to(key)
    before = contents(tmp_path)
    assert has_space(tmp_path)
    assert contents(tmp_path) == before


FOREIGN = [
    ".editor.tmp", ".000001.h5.0123abcd.tmp", "work/.draft.tmp", "samples/.x.tmp",
    "samples/000/.notes.h5.0123abcd.tmp", "samples/000/.000001.h5.tmp",
    "samples/more/.000001.h5.0123abcd.tmp", "errors/.000001.h5.0123abcd.tmp",
]  # fmt: skip


def put(folder: Path) -> None:
    for name in FOREIGN:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("of another program")


def test_somebodys_folder_is_left_alone(planned: PlannedSet, tmp_path: Path) -> None:
    home = tmp_path / "home"
    put(home)
    before = contents(home)
    with pytest.raises(InputError, match=r"neither empty nor a data set: it holds \.000001"):
        Run(planned, home)
    (home / "plan.yaml").write_text("name: of something else\n")
    before |= {"plan.yaml": b"name: of something else\n"}
    with pytest.raises(InputError, match="another plan"):
        Run(planned, home)
    assert contents(home) == before


def test_only_what_this_data_set_left_is_removed(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    Run(planned, folder)
    put(folder)
    begun = (".plan.yaml", ".probe", "errors/.000001.txt", "samples/000/.000001.npz",
             "metrics/000/.000001.json")  # fmt: skip
    left = [f"{name}.00112233.tmp" for name in begun]
    for name in left:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    Run(planned, folder)
    assert all((folder / name).exists() for name in FOREIGN)
    assert not any((folder / name).exists() for name in left)


def test_a_folder_as_a_killed_first_run_leaves_it(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    (folder / "samples/000").mkdir(parents=True)
    for name in (".lock", "manifest.sqlite", ".plan.yaml.0123abcd.tmp"):
        (folder / name).touch()
    assert Run(planned, folder).state.done == 5


def test_deep_finds_damage_that_keeps_the_size(planned: PlannedSet, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    Run(planned, folder)
    path = Layout(folder).capture(3)
    path.write_text("sample 9")
    assert Run(planned, folder).executor.asked == []
    again = Run(planned, folder, is_sound=has_its_content)
    assert again.executor.asked == [[3]]
    assert path.read_text() == "sample 3"
    assert "remaking 1 samples with missing or damaged files: 3" in again.said


def test_plans_that_grow_are_refused(tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text(
        f"name: some\nsamples: 1\nscenes: &a0 [{'{family: targets},' * 9}]\n"
        + "".join(f"vary{k}: &a{k} [{f'*a{k - 1},' * 9}]\n" for k in range(1, 9))
    )
    said = mistake("dataset", tmp_path / "plan.yaml", "--dry-run")
    assert "with its aliases expanded" in said
    assert len(said) < 400


def test_settings_that_grow_tell_nothing(capture: Capture) -> None:
    levels = "".join(f"a{k}: &a{k} [{f'*a{k - 1},' * 9}]\n" for k in range(1, 9))
    text = "data_set: {plan: abc, index: 1}\nmedia: [{name: fog}]\n"
    for settings, belongs in ((text, True), (f"a0: &a0 [{'x,' * 9}]\n{levels}{text}", False)):
        one = replace(capture, provenance=replace(capture.provenance, settings=settings))
        assert (origin_of(one) is not None) is belongs
        assert bool(media_of(one)) is belongs


KEEPS = f"{PLAN}keep: {{histograms: true}}\n"


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 4
    path.write_bytes(content)


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_lost_manifest_does_not_hide_a_flipped_bit(
    tmp_path: Path, capture: Capture, suffix: str
) -> None:
    planned, folder = write_plan(tmp_path, KEEPS), tmp_path / "set"
    put_captures(planned, folder, capture)
    flip(Layout(folder).capture(3).with_suffix(suffix))
    run = Run(planned, folder)
    assert run.executor.asked == [[3]]
    assert "found 4 samples that the manifest lacked" in run.said


def test_a_damaged_file_is_not_taken_up_again(tmp_path: Path, capture: Capture) -> None:
    planned, folder = write_plan(tmp_path, KEEPS), tmp_path / "set"
    put_captures(planned, folder, capture)
    assert Run(planned, folder).executor.asked == []
    with Layout(folder).capture(2).with_suffix(".npz").open("ab") as file:
        file.write(b"more")
    assert Run(planned, folder).executor.asked == [[2]]


def test_what_no_capture_vouches_for_is_made_again(tmp_path: Path, capture: Capture) -> None:
    planned, folder = write_plan(tmp_path, KEEPS), tmp_path / "set"
    put_captures(planned, folder, capture)
    settings = yaml.safe_dump({"data_set": {"plan": planned.digest, "index": 1}})
    provenance = replace(capture.provenance, settings=settings)
    write_capture(replace(capture, provenance=provenance), Layout(folder).capture(1))
    assert Run(planned, folder).executor.asked == [[1]]


def test_a_row_that_is_sound_is_read(own: Path) -> None:
    assert [record.index for record in read_manifest(own)[1]] == [0, 1, 2, 3]
    assert rows(own, "status")[3] == ("failed",)
