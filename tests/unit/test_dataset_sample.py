"""Making one sample: what ends as a reason, and what does not."""

import errno
from pathlib import Path
from types import SimpleNamespace

import pytest

from spisim.dataset import sample
from spisim.dataset.folder import Layout, Origin, origin_of
from spisim.dataset.planned import load_plan
from spisim.dataset.records import NO_SPACE, Outcome
from spisim.dataset.sample import Maker


@pytest.fixture
def make(tmp_path: Path) -> Maker:
    path = tmp_path / "plan.yaml"
    path.write_text("{name: one, samples: 3, scenes: [{family: targets}]}")
    return Maker(load_plan(path), tmp_path / "set")


def made_with(monkeypatch: pytest.MonkeyPatch, make: Maker, error: BaseException) -> Outcome:
    """Sample 1, where the light transport raises this."""

    def simulate(*arguments: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(sample, "simulate", simulate)
    return make(1)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (RuntimeError("two\nlines"), "RuntimeError: two lines"),
        (MemoryError(), "MemoryError:"),
        (FileNotFoundError(errno.ENOENT, "No such file", "a.ply"), "a.ply: No such file"),
    ],
)
def test_errors_become_reasons_of_one_line(
    monkeypatch: pytest.MonkeyPatch, make: Maker, error: Exception, reason: str
) -> None:
    outcome = made_with(monkeypatch, make, error)
    assert (outcome.index, outcome.status, outcome.error) == (1, "failed", reason)
    assert outcome.scene == make.planned.sample(1).scene_name
    assert outcome.parameters == make.planned.sample(1).parameters
    assert outcome.file is None
    assert outcome.seconds is not None
    text = Layout(make.folder).error(1).read_text()
    assert text.startswith("Traceback")
    assert type(error).__name__ in text


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_no_space_is_no_failure(monkeypatch: pytest.MonkeyPatch, make: Maker, number: int) -> None:
    outcome = made_with(monkeypatch, make, OSError(number, "full", "x.h5"))
    assert (outcome.status, outcome.error) == (NO_SPACE, "x.h5: full")
    assert not Layout(make.folder).error(1).exists()


def test_no_space_for_the_reason_either(monkeypatch: pytest.MonkeyPatch, make: Maker) -> None:
    def full(path: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, "full", str(path))

    monkeypatch.setattr(sample, "write_atomically", full)
    assert made_with(monkeypatch, make, RuntimeError("bad")).status == NO_SPACE


def test_ctrl_c_is_not_swallowed(monkeypatch: pytest.MonkeyPatch, make: Maker) -> None:
    with pytest.raises(KeyboardInterrupt):
        made_with(monkeypatch, make, KeyboardInterrupt())


@pytest.mark.parametrize(
    ("settings", "belongs"),
    [
        ("data_set: {plan: abc, index: 4}", Origin("abc", 4, {})),
        ("data_set: {plan: abc, index: 4, sidecars: {.npz: 1f}}", Origin("abc", 4, {".npz": "1f"})),
        ("data_set: {plan: abc, index: 4, sidecars: [1]}", None),
        ("spp: 7", None),
        ("data_set: abc", None),
        ("data_set: {plan: abc}", None),
        ("data_set: {plan: abc, index: x}", None),
        ("", None),
        ("[: broken", None),
    ],
)
def test_what_a_capture_tells_of_its_set(settings: str, belongs: Origin | None) -> None:
    capture = SimpleNamespace(provenance=SimpleNamespace(settings=settings))
    assert origin_of(capture) == belongs  # type: ignore[arg-type]
