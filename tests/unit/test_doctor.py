"""What the command finds out about a machine."""

import pytest

from spisim_app.cli import doctor


def test_cores_are_those_that_this_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor.sys, "platform", "linux")
    monkeypatch.setattr(doctor.os, "sched_getaffinity", {0: {2, 5, 7}}.get, raising=False)
    assert doctor.examine()["cores"] == 3
