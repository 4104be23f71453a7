"""Which tests run which lines of the packages, and how long each takes, in processes of theirs too.

    python tools/line_tests.py FOLDER [tests/unit ...]

Run in the tree that is measured; `FOLDER` gets coverage's own data, `lines`, with the name of a
test as context, and `tests.json`: how long each takes, and those that fail. tools/mutation.py
reads both.
"""

import json
import os
import sys
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path

import coverage
import pytest

PACKAGES = (
    *("spisim", "reconstruction", "app/spisim_app", "scenes/spisim_worlds"),
    *("formats/spisim_formats", "paper/spisim_paper", "serving/spisim_serving", "live/spisim_live"),
    "compare/spisim_compare",
    "inverse/spisim_inverse",
)
SETTINGS = """
[run]
source = {packages}
data_file = {data}
parallel = true
relative_files = true
concurrency = thread
context = ${{PYTEST_CURRENT_TEST}}
sigterm = true
disable_warnings = no-data-collected,module-not-imported,module-not-measured,already-imported
"""
STARTS = "import coverage; coverage.process_startup()\n"


class Watch:
    """Tells coverage which test is running, and adds up what its phases take."""

    def __init__(self, watched: coverage.Coverage) -> None:
        self._watched = watched
        self.seconds: dict[str, float] = defaultdict(float)
        self.failed: list[str] = []

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Lines that run from here on are this test's, those of its fixtures, too."""
        self._watched.switch_context(item.nodeid)
        return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Called after set-up, call and tear-down."""
        self.seconds[report.nodeid] += report.duration
        if report.failed:
            self.failed.append(report.nodeid)


def main() -> int:
    """Measure the tests that are named, or all of the fast ones."""
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True)
    settings, starting = folder / "coverage.ini", folder / "starting"
    settings.write_text(SETTINGS.format(packages=",".join(PACKAGES), data=folder / "lines"))
    starting.mkdir()
    (starting / "sitecustomize.py").write_text(STARTS)
    watched = coverage.Coverage(config_file=str(settings))
    inherited = os.environ.get("PYTHONPATH", "")
    os.environ |= {
        "COVERAGE_PROCESS_START": str(settings),
        "PYTHONPATH": os.pathsep.join(filter(None, [str(starting), inherited])),
    }
    watch = Watch(watched)
    watched.start()
    pytest.main(["--continue-on-collection-errors", *sys.argv[2:]], plugins=[watch])
    watched.stop()
    watched.save()
    together = coverage.Coverage(data_file=str(folder / "lines"), config_file=False)
    together.combine(map(str, folder.glob("lines.*")))
    together.save()
    seconds = {name: round(took, 4) for name, took in watch.seconds.items()}
    reported = {"seconds": seconds, "failed": sorted(set(watch.failed))}
    (folder / "tests.json").write_text(json.dumps(reported))
    return 0


if __name__ == "__main__":
    sys.exit(main())
