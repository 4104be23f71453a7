"""Writing: whole files or nothing, and refusal in good time of what cannot be written."""

import os
from pathlib import Path

import pytest

from reconstruction.errors import InputError, explain, naming
from reconstruction.files import require_file, require_folder, write_atomically


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
        tmp_path: "is a folder; the name of a file is needed",
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
