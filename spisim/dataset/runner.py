"""Run a data set: make missing samples, record outcomes, wait for disk space."""

import logging
import os
import secrets
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from reconstruction.base.errors import InputError
from reconstruction.base.files import PROBE
from reconstruction.base.folders import locked_folder
from spisim.dataset.folder import Layout, Sound, has_its_size
from spisim.dataset.manifest import Manifest
from spisim.dataset.opening import Say, opened
from spisim.dataset.planned import PlannedSet
from spisim.dataset.records import NO_SPACE, Outcome
from spisim.dataset.sample import is_out_of_space
from spisim.dataset.workers import Executor

logger = logging.getLogger(__name__)

#: Free space needed to resume after the disk was full, and how often to check.
SPACE_NEEDED_BYTES = 4 * 2**20
SPACE_CHECK_S = 5.0
#: Default time to wait for space.
SPACE_TIMEOUT_S = 3600.0


class OutOfSpace(OSError):
    """The disk stayed full for too long; finished samples are safe."""


@dataclass(frozen=True)
class State:
    """Progress of a run."""

    samples: int  # total in the folder after the run
    done: int
    failed: int
    made: int  # in this run
    seconds: float  # of this run

    @property
    def missing(self) -> int:
        """Number of samples not attempted yet."""
        return self.samples - self.done - self.failed

    @property
    def fraction(self) -> float:
        """Fraction of the samples that were attempted."""
        return 1 - self.missing / self.samples


def run_dataset(
    planned: PlannedSet,
    folder: Path,
    executor: Executor,
    *,
    only: Collection[int] | None = None,
    retry_failed: bool = False,
    is_sound: Sound = has_its_size,
    space_timeout_s: float = SPACE_TIMEOUT_S,
    say: Say = print,
    progress: Callable[[State], None] = lambda state: None,
) -> State:
    """Make all samples of a plan that a folder lacks, or `only` some of them.

    `is_sound` decides whether an existing file is as it was written; samples with unsound files are
    made again. Failed samples are retried only if asked for, except that one that killed its worker
    gets a second attempt.

    Raises InputError as `locked_folder` and `opened` do, and if workers do not share the folder;
    OutOfSpace after waiting too long for space.
    """
    with locked_folder(folder), opened(planned, folder, say, is_sound) as manifest, executor:
        wanted = range(planned.plan.size) if only is None else only
        samples = planned.plan.size if only is None else len(manifest.indices() | {*only})
        run = _Run(Layout(folder), manifest, wanted, samples, space_timeout_s, say)
        progress(run.state)
        to_do = run.to_do(failed_too=retry_failed)
        fruitless = False
        while to_do:
            postponed = set()
            for outcome in executor.run(to_do):
                if outcome.status == NO_SPACE:
                    postponed.add(outcome.index)
                    run.wait_for_space()
                else:
                    run.record(outcome)
                    progress(run.state)
            if fruitless and len(postponed) == len(to_do):
                raise OutOfSpace(f"{folder}: samples need more space than is available")
            fruitless = len(postponed) == len(to_do)
            to_do = sorted({*run.to_do(), *postponed})
        return run.state


class _Run:
    def __init__(
        self,
        layout: Layout,
        manifest: Manifest,
        wanted: Collection[int],
        samples: int,
        patience_s: float,
        say: Say,
    ) -> None:
        self._layout = layout
        self._manifest = manifest
        self._wanted = wanted
        self._samples = samples
        self._patience_s = patience_s
        self._say = say
        self._made = 0
        self._began = time.monotonic()

    @property
    def state(self) -> State:
        seconds = time.monotonic() - self._began
        return State(self._samples, **self._manifest.counts(), made=self._made, seconds=seconds)

    def to_do(self, *, failed_too: bool = False) -> list[int]:
        below = max(self._wanted, default=-1) + 1
        missing = self._manifest.to_do(below, failed_too=failed_too)
        return [index for index in missing if index in self._wanted]

    def record(self, outcome: Outcome) -> None:
        if outcome.file is not None and not (self._layout.folder / outcome.file).is_file():
            raise InputError(
                f"{self._layout.folder}: {outcome.file} was written by a worker, but is not there; "
                "all workers must share this folder"
            )
        while True:
            try:
                self._manifest.record(outcome)
            except OSError as error:
                if not is_out_of_space(error):
                    raise
                self.wait_for_space()
            else:
                self._made += 1
                _log(outcome)
                return

    def wait_for_space(self) -> None:
        began = time.monotonic()
        if has_space(self._layout.folder):
            return
        self._say(f"{self._layout.folder}: no space left; waiting")
        while not has_space(self._layout.folder):
            if time.monotonic() - began > self._patience_s:
                raise OutOfSpace(
                    f"{self._layout.folder}: no space left for {self._patience_s:g} s; free some "
                    "and run the same command again to continue"
                )
            time.sleep(SPACE_CHECK_S)
        self._say("Space is available again; continuing")


def _log(outcome: Outcome) -> None:
    if outcome.done:
        logger.info("sample %d: %.1f s", outcome.index, outcome.seconds or 0.0)
    else:
        logger.warning("sample %d failed: %s", outcome.index, outcome.error)


def has_space(folder: Path) -> bool:
    """Return whether a file larger than a sample can be written, within quotas."""
    probe = folder / f".{PROBE}.{secrets.token_hex(4)}.tmp"
    try:
        with probe.open("xb") as file:  # overwrites no file and follows no link
            file.write(os.urandom(SPACE_NEEDED_BYTES))
    except OSError as error:
        if not is_out_of_space(error):
            raise
        return False
    finally:
        with suppress(OSError):
            probe.unlink()
    return True
