"""Run a data set: make what is missing, note how it went, wait where there is no space."""

import logging
import os
import secrets
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from reconstruction.base.errors import InputError
from reconstruction.base.folders import locked_folder
from spisim.dataset.folder import Layout, Sound, has_its_size
from spisim.dataset.manifest import Manifest
from spisim.dataset.opening import Say, opened
from spisim.dataset.planned import PlannedSet
from spisim.dataset.records import NO_SPACE, Outcome
from spisim.dataset.sample import is_out_of_space
from spisim.dataset.workers import Executor

logger = logging.getLogger(__name__)

#: Space that has to be free before a run that ran out of it goes on, and how often to look.
SPACE_NEEDED_BYTES = 4 * 2**20
LOOK_EVERY_S = 5.0
#: Default of how long to wait for space.
SPACE_TIMEOUT_S = 3600.0


class OutOfSpace(OSError):
    """There was no space for too long; what is done is safe."""


@dataclass(frozen=True)
class State:
    """How far a run is."""

    samples: int  # that the folder is to have
    done: int
    failed: int
    made: int  # in this run
    seconds: float  # of this run

    @property
    def missing(self) -> int:
        """Samples not tried yet."""
        return self.samples - self.done - self.failed

    @property
    def fraction(self) -> float:
        """Of the samples, those that are tried."""
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
    """Make all samples of a plan in a folder that are not there yet, or `only` some of them.

    `is_sound` tells of the files that are there whether they are as they were written; samples of
    others are made again. Samples that failed stay so unless they are to be tried again; one that
    took its worker with it is tried once more in any case.

    Raises InputError as `locked_folder` and `opened` do, and where workers write into another
    folder of the same name; OutOfSpace after waiting for space for too long.
    """
    with (
        locked_folder(folder),
        opened(planned, folder, say, is_sound) as manifest,
        executor,
    ):
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
                raise OutOfSpace(f"{folder}: no space for a sample, even where there is some")
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
                f"{self._layout.folder}: a worker wrote {outcome.file}, which is not there; the "
                "folder has to be one that all workers share"
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
        self._say(f"{self._layout.folder}: no space left; waiting for some")
        while not has_space(self._layout.folder):
            if time.monotonic() - began > self._patience_s:
                raise OutOfSpace(
                    f"{self._layout.folder}: no space left for {self._patience_s:g} s; make some "
                    "and run the same command again to go on"
                )
            time.sleep(LOOK_EVERY_S)
        self._say("There is space again; going on")


def _log(outcome: Outcome) -> None:
    if outcome.done:
        logger.info("sample %d: %.1f s", outcome.index, outcome.seconds or 0.0)
    else:
        logger.warning("sample %d failed: %s", outcome.index, outcome.error)


def has_space(folder: Path) -> bool:
    """Whether a file can be written that is larger than a sample; quotas count too."""
    probe = folder / f".space.{secrets.token_hex(4)}.tmp"
    try:
        with probe.open("xb") as file:  # never what is there already, or behind a link
            file.write(os.urandom(SPACE_NEEDED_BYTES))
    except OSError as error:
        if not is_out_of_space(error):
            raise
        return False
    finally:
        with suppress(OSError):
            probe.unlink()
    return True
