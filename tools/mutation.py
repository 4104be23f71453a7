"""Do the tests notice a fault? A sample of single-point faults over all packages, one at a time.

    python tools/mutation.py [--mutants 300] [--seed 0] [--workers 2] [--again]

Each fault gets the fast tests that run its line, the quickest first, until one fails: an hour or
two on two cores. Which tests run which lines is measured once, kept in out/mutation/map and
measured again for tests that changed, or as a whole where a package did. `--again` takes those
that survived last time. Faults that change nothing that matters stand, with the reason, in
tools/mutation_equivalents.yaml. mutmut and Cosmic Ray can neither draw a sample over packages nor
choose tests by line.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from fnmatch import fnmatch
from functools import cache
from itertools import accumulate
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import coverage
import yaml

from mutators import Mutant, mutants

ROOT = Path(__file__).parents[1]
WORK = ROOT / "out" / "mutation"
EQUIVALENTS = Path(__file__).with_name("mutation_equivalents.yaml")
PACKAGES = (
    *("spisim", "reconstruction", "app/spisim_app", "scenes/spisim_worlds"),
    *("formats/spisim_formats", "paper/spisim_paper", "serving/spisim_serving", "live/spisim_live"),
    "compare/spisim_compare",
    "inverse/spisim_inverse",
)
MIN_KILLED = 0.85
MAX_TESTS_S = 120.0
"""Of the tests of one fault, as long as they took when measured; slower ones are left out."""
START_S, SLOWER = 120.0, 5.0
"""What pytest may take to start, and the tests over what they took when measured, to be in time."""


@dataclass(frozen=True)
class Verdict:
    """What became of a fault: `killed`, `survived`, or `equivalent` with a reason."""

    mutant: Mutant
    outcome: str
    tests: int
    left_out: int
    reason: str = ""


class Map:
    """Which tests run which lines, as measured in parts, the latest of a test file last."""

    def __init__(self, parts: Sequence[Path]) -> None:
        self.seconds: dict[str, float] = {}
        self._parts: list[tuple[coverage.CoverageData, set[str]]] = []
        for part in parts:
            fields = json.loads((part / "tests.json").read_text())
            data = coverage.CoverageData(str(part / "lines"))
            data.read()
            files = {test.partition("::")[0] for test in fields["seconds"]}
            self._forget(files)
            sound = set(fields["seconds"]) - set(fields["failed"])
            self.seconds |= {test: fields["seconds"][test] for test in sound}
            self._parts.append((data, sound))

    def _forget(self, files: set[str]) -> None:
        def retained(test: str) -> bool:
            return test.partition("::")[0] not in files

        self.seconds = {test: took for test, took in self.seconds.items() if retained(test)}
        self._parts = [(data, set(filter(retained, sound))) for data, sound in self._parts]

    @cache  # noqa: B019 - one map per run
    def lines(self, file: str) -> dict[int, set[str]]:
        """Tests by the line of a file."""
        result: dict[int, set[str]] = defaultdict(set)
        for data, sound in self._parts:
            for line, contexts in data.contexts_by_lineno(file).items():
                # A process of a test's own says in which phase of the test it was started.
                names = {each.partition("|")[0].partition(" (")[0] for each in contexts}
                result[line] |= names & sound
        return result

    def tests(self, mutant: Mutant) -> list[str]:
        """Tests that run a fault, the quickest first.

        What is run on import, or compiled, is seen in none: then those of its function, file or
        folder, and those in files that import its module.
        """
        result = self._ran(mutant)
        if mutant.lines is None and mutant.function is None:
            result = result | self._importing(mutant.file)
        return sorted(result, key=lambda test: (self.seconds[test], test))

    def _ran(self, mutant: Mutant) -> set[str]:
        lines = self.lines(mutant.file)
        spans = [mutant.lines, mutant.function, (0, sys.maxsize)]
        for first, last in filter(None, spans):
            result = set().union(*(each for line, each in lines.items() if first <= line <= last))
            if result:
                return result
        folder = Path(mutant.file).parent
        beside = (self.lines(str(each)) for each in sorted(folder.glob("*.py")))
        return set().union(*(tests for each in beside for tests in each.values()))

    def _importing(self, file: str) -> set[str]:
        module = module_of(file)
        files = {each for each in tests_of(ROOT) if module in Path(each).read_text()}
        return {test for test in self.seconds if test.partition("::")[0] in files}


def main() -> int:
    """Measure what has changed, try the faults, report; 0 if enough are killed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--mutants", type=int, default=300, help="how many")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--workers", type=int, default=2, help="tried at a time")
    parser.add_argument("--again", action="store_true", help="only those that survived last time")
    options = parser.parse_args()
    os.chdir(ROOT)
    measured = Map(up_to_date(WORK / "map", options.workers))
    chosen = sample(options.mutants, options.seed)
    report = WORK / "report.json"
    if options.again:
        before = json.loads(report.read_text())
        survived = {(m["file"], m["line"], m["old"], m["start"]) for m in before["survivors"]}
        chosen = [m for m in chosen if (m.file, m.line, m.old, m.start) in survived]
    verdicts = list(tried(chosen, measured, options.workers))
    print(table(verdicts))
    for verdict in verdicts:
        if verdict.outcome != "killed":
            print(said(verdict))
    survivors = [asdict(each.mutant) for each in verdicts if each.outcome == "survived"]
    report.write_text(json.dumps({"survivors": survivors}))
    return 0 if score(verdicts) >= MIN_KILLED else 1


def sources() -> list[str]:
    """Files of the packages."""
    listed = subprocess.run(
        ["git", "ls-files", *(f"{package}/*.py" for package in PACKAGES)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return listed.stdout.split()


def module_of(file: str) -> str:
    """Dotted name of a file of the packages, as an import has it."""
    package = next(each for each in PACKAGES if file.startswith(f"{each}/"))
    return ".".join(Path(file).relative_to(Path(package).parent).with_suffix("").parts)


def tests_of(tree: Path) -> list[str]:
    """Files of tests."""
    return sorted(str(each.relative_to(tree)) for each in tree.glob("tests/*/test_*.py"))


def package_of(file: str) -> str:
    """The folder below `spisim` or `reconstruction`, or either for what lies there itself."""
    parts = Path(file).parts
    return "/".join(parts[:2]) if len(parts) > 2 else parts[0]


def sample(wanted: int, seed: int) -> list[Mutant]:
    """Faults of every package, of large ones more, by the root of how many there are.

    A fault's rank is a digest of itself: most of a sample stays the same when code changes.
    """
    free = [each["files"] for each in exceptions()["free_numbers"]]
    by_package: dict[str, list[Mutant]] = defaultdict(list)
    for file in sources():
        chosen_freely = any(fnmatch(file, pattern) for pattern in free)
        by_package[package_of(file)] += (
            mutant
            for mutant in mutants(file, Path(file).read_bytes())
            if not (chosen_freely and mutant.is_number)
        )
    roots = {package: len(each) ** 0.5 for package, each in by_package.items()}
    chosen: list[Mutant] = []
    for package, each in sorted(by_package.items()):
        count = max(round(wanted * roots[package] / sum(roots.values())), 1)
        chosen += sorted(each, key=lambda mutant: _rank(mutant, seed))[:count]
    return sorted(chosen, key=lambda mutant: _rank(mutant, seed))  # stopped early, it is a sample


def exceptions() -> dict[str, list[dict[str, str]]]:
    """What is not held against the tests, and why."""
    result: dict[str, list[dict[str, str]]] = yaml.safe_load(EQUIVALENTS.read_text())
    return result


def _rank(mutant: Mutant, seed: int) -> bytes:
    text = f"{seed} {mutant.file} {mutant.text} {mutant.change} {mutant.start % 7}"
    return hashlib.sha256(text.encode()).digest()


def up_to_date(folder: Path, workers: int) -> list[Path]:
    """Parts of the map, oldest first; what it lacks is measured, by as many processes."""
    packages = _digest([Path(file) for file in sources()])
    if (folder / "packages").is_file() and (folder / "packages").read_text() != packages:
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "packages").write_text(packages)
    tests = {file: _digest([Path(file)]) for file in tests_of(ROOT)}
    retained = folder / "measured.json"
    measured: dict[str, str] = json.loads(retained.read_text()) if retained.is_file() else {}
    new = [file for file, digest in tests.items() if measured.get(file) != digest]
    if new:
        first = len(list(folder.glob("part-*")))
        dealt = [new[number::workers] for number in range(min(workers, len(new)))]
        with ThreadPoolExecutor(workers) as pool:
            parts = [folder / f"part-{first + number:03d}" for number in range(len(dealt))]
            list(pool.map(_measure, parts, dealt))
        retained.write_text(json.dumps(tests))
    return sorted(folder.glob("part-*"))


def _measure(part: Path, tests: Sequence[str]) -> None:
    shutil.rmtree(part, ignore_errors=True)
    tree = copied(WORK / f"tree-{part.name}")
    subprocess.run(
        [sys.executable, str(Path(__file__).with_name("line_tests.py")), str(part), *tests],
        cwd=tree, env=_environment(tree), check=True,
    )  # fmt: skip
    shutil.rmtree(tree)


def _digest(files: Sequence[Path]) -> str:
    result = hashlib.sha256()
    for file in files:
        result.update(f"{file}\n".encode() + file.read_bytes())
    return result.hexdigest()


def copied(tree: Path) -> Path:
    """A copy of the working tree, in which faults are made."""
    shutil.rmtree(tree, ignore_errors=True)
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], check=True,
                            capture_output=True, text=True)  # fmt: skip
    for name in filter(None, listed.stdout.split("\0")):
        if Path(name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(name, tree / name)
    return tree


def _environment(tree: Path) -> dict[str, str]:
    """Every package comes from the tree, whatever is installed."""
    inherited = os.environ.get("PYTHONPATH", "")
    roots = dict.fromkeys(str((tree / package).parent) for package in PACKAGES)
    path = os.pathsep.join(filter(None, [*roots, inherited]))
    # A file and its fault may be as long, and as old to the second: nothing compiled is kept.
    return {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}


def tried(chosen: Sequence[Mutant], measured: Map, workers: int) -> Iterator[Verdict]:
    """Each fault in turn, in copies of the tree."""
    equivalent = {
        (each["file"], each["line"], each["change"]): each["reason"]
        for each in exceptions()["equivalent"]
    }
    trees: SimpleQueue[Path] = SimpleQueue()
    for number in range(workers):
        trees.put(copied(WORK / f"tree-{number}"))

    def attempt(mutant: Mutant) -> Verdict:
        reason = equivalent.get((mutant.file, mutant.text, mutant.change))
        if reason is not None:
            return Verdict(mutant, "equivalent", 0, 0, reason)
        every = measured.tests(mutant)
        spent_s = list(accumulate(measured.seconds[test] for test in every))
        count = max(sum(each <= MAX_TESTS_S for each in spent_s), min(len(every), 1))
        tests, tree = every[:count], trees.get()
        try:
            limit_s = START_S + SLOWER * (spent_s[count - 1] if tests else 0)
            outcome = "killed" if tests and noticed(mutant, tree, tests, limit_s) else "survived"
        finally:
            trees.put(tree)
        return Verdict(mutant, outcome, len(tests), len(every) - len(tests))

    with ThreadPoolExecutor(workers) as pool:
        for number, verdict in enumerate(pool.map(attempt, chosen)):
            print(f"{number + 1}/{len(chosen)} {said(verdict)}", file=sys.stderr, flush=True)
            yield verdict


def noticed(mutant: Mutant, tree: Path, tests: Sequence[str], limit_s: float) -> bool:
    """Whether a test fails, or they do not end in time, with the fault in the tree."""
    file = tree / mutant.file
    sound = file.read_bytes()
    listed = tree / "tests-of-a-fault.txt"
    listed.write_text("\n".join(tests))
    try:
        file.write_bytes(mutant.applied(sound))
        run = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", f"@{listed.name}"],
            cwd=tree, env=_environment(tree), capture_output=True, timeout=limit_s,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return True
    finally:
        file.write_bytes(sound)
    broken = b"ERROR collecting" in run.stdout or b"while loading conftest" in run.stderr
    if run.returncode in (4, 5) and not broken:
        raise RuntimeError(f"{said_mutant(mutant)}: {run.stdout.decode()[-2000:]}")
    return run.returncode != 0


def score(verdicts: Sequence[Verdict]) -> float:
    """Killed, of those that change something."""
    fates = [each.outcome for each in verdicts if each.outcome != "equivalent"]
    return fates.count("killed") / max(len(fates), 1)


def table(verdicts: Sequence[Verdict]) -> str:
    """By package, and of all."""
    by_package: dict[str, list[Verdict]] = defaultdict(list)
    for each in verdicts:
        by_package[package_of(each.mutant.file)].append(each)
    lines = [f"{'package':30} faults  killed  survived  equivalent  score"]
    for package, some in [*by_package.items(), ("all", list(verdicts))]:
        fates = [each.outcome for each in some]
        counts: tuple[Any, ...] = tuple(map(fates.count, ("killed", "survived", "equivalent")))
        cells = "{:6d}  {:6d}  {:8d}  {:10d}".format(len(some), *counts)
        lines.append(f"{package:30} {cells}  {100 * score(some):4.0f} %")
    return "\n".join(lines)


def said(verdict: Verdict) -> str:
    """One line."""
    left_out = f", {verdict.left_out} slow ones left out" if verdict.left_out else ""
    reported = verdict.reason or f"{verdict.tests} tests{left_out}"
    return f"{verdict.outcome}: {said_mutant(verdict.mutant)} ({reported})"


def said_mutant(mutant: Mutant) -> str:
    """Where it is and what it says."""
    return f"{mutant.file}:{mutant.line}: {mutant.change} in `{mutant.text}`"


if __name__ == "__main__":
    sys.exit(main())
