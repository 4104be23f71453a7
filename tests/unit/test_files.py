"""Writing: whole files or nothing, and refusal in good time of what cannot be written."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from reconstruction.base.errors import InputError, explain, naming
from reconstruction.base.files import (
    SPARE_BYTES,
    Output,
    is_marked,
    mark,
    require_file,
    require_folder,
    require_outputs,
    write_atomically,
)


def test_a_file_is_written_with_the_folders_above_it(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "c.txt"
    write_atomically(path, b"one")
    write_atomically(path, b"two")
    assert path.read_bytes() == b"two"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failed_write_leaves_neither_file_nor_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    def fail(_: int) -> None:
        raise error

    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(type(error)):
        write_atomically(tmp_path / "a" / "b" / "c.txt", b"one")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_keeps_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "c.txt"
    path.write_bytes(b"old")

    def no_space(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", no_space)
    with pytest.raises(OSError, match=r"No space left on device: '.*/c\.txt'$"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("write", [require_file, lambda path: write_atomically(path, b"x")])
def test_what_is_no_regular_file_is_refused(write, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").touch()
    for path, message in {
        Path("/dev/null"): "/dev/null is not a regular file",
        tmp_path / "pipe": "pipe is not a regular file",
        tmp_path: "is a folder; a file name is needed",
        tmp_path / "file" / "x" / "y": "file is not a folder",
    }.items():
        with pytest.raises(InputError, match=message):
            write(path)
    assert Path("/dev/null").is_char_device()


def test_testing_a_place_does_not_change_it(tmp_path: Path) -> None:
    require_folder(tmp_path / "a" / "b")
    require_file(tmp_path / "a" / "b" / "c.h5")
    assert list(tmp_path.iterdir()) == []


def test_a_relative_place_is_seen_from_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    require_folder("out/demo")
    Path("out").touch()
    with pytest.raises(InputError, match=r"cannot write into out/demo: .*out is not a folder"):
        require_folder("out/demo")


def test_a_folder_without_permission_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def denied(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "touch", denied)  # root may write anywhere
    with pytest.raises(InputError, match=r"cannot write into .*: permission denied$"):
        require_file(tmp_path / "x.h5")


def test_errors_tell_the_file() -> None:
    assert (
        explain(OSError(28, "No space left on device", "c.h5")) == "c.h5: No space left on device"
    )
    assert explain(OSError("lost")) == "lost"
    with pytest.raises(InputError, match=r"^c\.h5: no such frame$"), naming("c.h5"):
        raise InputError("no such frame")
    with pytest.raises(KeyError), naming("c.h5"):
        raise KeyError("x")


def _mine(path: Path, kind: str = "notes") -> Path:
    path.write_bytes(b"-" * 9000 + mark(kind).encode())
    return path


def test_a_mark_is_found_at_either_end_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "x"
    for content, marked in {
        mark("notes").encode() + b"-" * 9000: True,
        b"-" * 9000 + mark("notes").encode(): True,
        b"-" * 9000 + mark("notes").encode() + b"-" * 9000: False,
        mark("note").encode(): False,
        b"": False,
    }.items():
        path.write_bytes(content)
        assert is_marked(path, "notes") == marked


def test_only_earlier_outputs_of_the_same_kind_are_overwritten(tmp_path: Path) -> None:
    new, own, foreign = tmp_path / "new", _mine(tmp_path / "own"), tmp_path / "foreign"
    foreign.write_text("of someone else")
    require_outputs([Output(new, "notes"), Output(own, "notes")])
    for output in (Output(own, "letters"), Output(foreign, "notes")):
        with pytest.raises(InputError, match="--overwrite replaces it"):
            require_outputs([output])
        require_outputs([output], overwrite=True)
    require_outputs([Output(foreign, "notes", sign="of someone")])


def test_an_input_is_never_an_output(tmp_path: Path) -> None:
    scene = _mine(tmp_path / "scene")
    (tmp_path / "link").symlink_to(scene)
    (tmp_path / "hard").hardlink_to(scene)
    (tmp_path / "folder").mkdir()
    for path in (scene, tmp_path / "folder" / ".." / "scene", tmp_path / "link", tmp_path / "hard"):
        with pytest.raises(InputError, match="is read by this command"):
            require_outputs([Output(path, "notes")], [scene], overwrite=True)
    own, part = _mine(tmp_path / "folder" / "own"), tmp_path / "folder" / "part"
    part.write_text("of a data set")
    require_outputs([Output(own, "notes")], [tmp_path / "folder"])
    with pytest.raises(InputError, match=r"belongs to .*folder, which is read"):
        require_outputs([Output(part, "notes")], [tmp_path / "folder"], overwrite=True)


def test_a_link_is_replaced_and_not_what_it_points_to(tmp_path: Path) -> None:
    target, link, lost = _mine(tmp_path / "target"), tmp_path / "link", tmp_path / "lost"
    link.symlink_to(target)
    lost.symlink_to(tmp_path / "nowhere")
    for path in (link, lost):
        with pytest.raises(InputError, match="is a symbolic link; --overwrite replaces the link"):
            require_outputs([Output(path, "notes")])
        require_outputs([Output(path, "notes")], overwrite=True)
        write_atomically(path, b"new")
    assert target.read_bytes().startswith(b"---")
    assert link.read_bytes() == lost.read_bytes() == b"new"
    assert not (tmp_path / "nowhere").exists()


def test_two_outputs_need_two_names(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path, target_is_directory=True)
    with pytest.raises(InputError, match="the page and the notes need two names"):
        require_outputs([Output(tmp_path / "x", "notes"), Output(tmp_path / "link" / "x", "page")])


def test_names_have_endings_and_limits(tmp_path: Path) -> None:
    endings = (".h5", ".hdf5")
    for name, message in {
        "x.hdf": r"x\.hdf: '\.hdf' is no ending of a capture: did you mean '\.hdf5'\? allowed: ",
        "x": r"x: an ending is missing of this capture: allowed: \.h5, \.hdf5",
        "n" * 245 + ".h5": "a file name has at most 241 bytes",
        "n" * 245 + "/x.h5": None,
        "n" * 256 + "/x.h5": "File name too long|has at most",
        "x\0.h5": "must not contain a null character",
    }.items():
        outputs = [Output(tmp_path / name, "capture", endings)]
        if message is None:
            require_outputs(outputs)
            continue
        with pytest.raises((InputError, OSError), match=message):
            require_outputs(outputs)
    require_outputs([Output(tmp_path / "X.H5", "capture", endings)])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no such file system")
def test_a_place_that_only_looks_writable_is_told(tmp_path: Path) -> None:
    for position in ("/proc/x", "/proc/self/fd/deep/x", "/sys/x"):
        with pytest.raises(InputError, match="cannot write into "):
            require_outputs([Output(Path(position), "notes")])


def test_a_full_disk_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = SimpleNamespace(total=10**12, free=SPARE_BYTES + 3_000_000)
    monkeypatch.setattr("shutil.disk_usage", lambda _: free)
    outputs = [Output(tmp_path / name, "notes", size_bytes=1_600_000) for name in "ab"]
    require_outputs(outputs[:1])
    with pytest.raises(InputError, match=r"has 7 MB left, 7\.2 MB are needed"):
        require_outputs(outputs)
