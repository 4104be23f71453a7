"""Words of strangers in pages, tables, pictures and terminals: shown as they are, doing nothing."""

import csv
import io
import json
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
import yaml

import spisim.dataset
from commands import spisim as call
from datasets import change, make_set
from reconstruction import Capture, evaluate, reconstruct
from reconstruction.base.text import json_line, printable
from reconstruction.cli import main as rig
from scenefiles import MINIMAL
from spisim.base.config.files import csv_table
from spisim.dataset.records import Record
from spisim.dataset.study.evaluation import Evaluation
from spisim.dataset.study.results import results_csv, results_of, summary_csv
from spisim_app.cli import main
from spisim_app.cli.console import print_json, results, say, warn
from spisim_app.cli.tables import plain_table
from spisim_app.report.capture import write_report
from spisim_app.report.contact_sheet import write_contact_sheet
from spisim_app.report.page import page_script
from spisim_app.report.study import write_study
from studies import planned

NAMES = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "'><svg/onload=alert(1)>",
    "javascript:alert(1)",
    "{{ 7 * 7 }}{% raw %}",
    "=cmd|' /C calc'!A0",
    "\x1b]0;x\x07\x1b[2J",
    "\x9b31m\x85\x7f",
    "\u202elive\u2066\u2029",
    "$\\frac{$",
    "[red]a[/red] :car:",
)
ALL = " ".join(NAMES)
STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


class Page(HTMLParser):
    """What could act in a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.text = ""
        page = path.read_text(encoding="utf-8")
        assert STEERING.search(page) is None
        assert f"script-src '{page_script().digest}'" in page
        own = f"<script>{page_script().text}</script>"
        assert page.count(own) == 1
        self.feed(page.replace(own, ""))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag not in {"script", "iframe", "object", "embed", "form", "a", "link", "image"}
        for name, value in attrs:
            assert not name.startswith("on")
            if name in {"src", "href", "action", "data"}:
                assert value is not None
                assert value.startswith("#" if tag == "use" else "data:image/")

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_page_of_a_capture_shows_names_as_they_are(capture: Capture, tmp_path: Path) -> None:
    name = ALL
    settings = yaml.safe_dump({"media": [{"where": name, "kind": name, name: 1}]})
    reported = replace(capture.provenance, software=name, created=name, instrument=name, scene=name)
    foreign = replace(capture, provenance=replace(reported, settings=settings))
    result = reconstruct(foreign)
    write_report(
        tmp_path / "report.html",
        foreign,
        result,
        metrics=evaluate(result, foreign),
        timings={name: 1.0},
        title=name,
    )
    assert Page(tmp_path / "report.html").text.count(printable(name)) >= 6


def test_a_contact_sheet_shows_names_as_they_are(capture: Capture, tmp_path: Path) -> None:
    name = ALL
    folder = make_set(tmp_path / "set", capture, done=2, failed=0)
    quoted = name.replace("'", "''")
    change(folder, f"UPDATE samples SET scene = '{quoted}'")
    parameters = json.dumps({name: name, "list": [name]}).replace("'", "''")
    change(folder, f"UPDATE samples SET parameters = '{parameters}' WHERE \"index\" = 0")
    change(folder, f"UPDATE meta SET value = '{quoted}' WHERE key IN ('name', 'software')")
    write_contact_sheet(tmp_path / "sheet.html", spisim.dataset.open(folder))
    assert Page(tmp_path / "sheet.html").text.count(printable(name)) >= 5


METRICS = ["range_bias_m", "depth_mae_m"]


def _results(names: tuple[str, ...], folder: Path) -> Any:
    """Each name in one condition, with a sample that is made and one that fails."""
    study = planned(
        folder,
        {"x": "scene.description", "reference": names[0], "metrics": METRICS},
        name=ALL,
        description=ALL,
        vary={"scene.description": {"grid": list(names)}},
    )
    records = [
        Record(
            index,
            "failed" if index >= len(names) else "done",
            scene=name,
            parameters={"scene": name, "scene.description": name},
            error=name if index >= len(names) else None,
        )
        for index, name in enumerate(names * 2)
    ]
    evaluations = {k: Evaluation(dict.fromkeys(METRICS, 1.5 + k)) for k in range(len(names))}
    return results_of(study, records, evaluations)


def test_pages_plots_and_tables_of_a_study_show_names_as_they_are(tmp_path: Path) -> None:
    names = (*NAMES, "@x", "\tx")
    result = _results(names, tmp_path)
    write_study(tmp_path / "out", result)
    text = Page(tmp_path / "out" / "report.html").text
    assert text.count(printable(ALL)) >= 2
    for name in names:
        assert text.count(printable(name)) >= 3 + text.count(printable(ALL)) * ALL.count(name)
    for table in (results_csv(result), summary_csv(result)):
        assert STEERING.search(table) is None
        for row in csv.reader(io.StringIO(table)):
            assert not any(_is_formula(cell) for cell in row)


def _is_formula(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return cell.startswith(("=", "+", "-", "@", "\t", "\r"))
    return False


def test_formulas_in_tables_are_words_and_numbers_stay() -> None:
    cells = ["=1+1", "+1", "-1", "-1e-3", "-x", "@sum", "\tx", "\rx", "＝1", -2.5, "a=b", "", None]
    (row,) = csv.reader(io.StringIO(csv_table([cells])))
    assert row == [
        *("'=1+1", "+1", "-1", "-1e-3", "'-x", "'@sum", "'\tx", "\\x0dx", "'＝1"),
        *("-2.5", "a=b", "", ""),
    ]


def test_a_picture_of_a_scene_shows_its_name(tmp_path: Path) -> None:
    name = ALL
    fields = yaml.safe_load(MINIMAL)
    fields["name"] = fields["objects"][0]["name"] = name
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(fields))
    run = call("scenes", "show", tmp_path / "scene.yaml", "-o", tmp_path / "scene.png")
    assert run.exit_code == 0, run.exception
    assert printable(name) in run.stdout
    assert STEERING.search(run.output) is None


@pytest.mark.parametrize("name", NAMES)
def test_terminals_are_not_steered(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    say(name, style="red")
    warn([name])
    table = plain_table(name, name)
    table.add_row(name, name)
    results.print(table, width=400)
    print_json({name: [name, Path(name)]})
    out, err = capsys.readouterr()
    assert STEERING.search(out + err) is None
    assert err.count(printable(name)) == 2
    assert out.count(printable(name)) >= 4
    assert json.loads(out.splitlines()[-1]) == {name: [name, name]}


@pytest.mark.parametrize("name", NAMES)
def test_wrong_arguments_steer_no_terminal(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for arguments in (
        ("simulate", name, "-o", tmp_path / "x.h5"),
        ("simulate", "warehouse", "-o", tmp_path / name),
        ("simulate", "warehouse", "-o", tmp_path / "x.h5", "--seed", name),
        ("simulate", "warehouse", "-o", tmp_path / "x.h5", f"--{name}"),
        (name,),
    ):
        run = call(*arguments)
        assert run.exit_code == 2
        assert STEERING.search(run.output) is None
    assert rig([name, "-o", str(tmp_path / "x")]) == 2
    for words in (["c.h5", "-o", "x", "--frame", name], [f"--{name}"]):
        with pytest.raises(SystemExit, match="2"):
            rig(words)
    assert STEERING.search("".join(capsys.readouterr())) is None


def test_json_is_ascii() -> None:
    assert json_line({"a": "×\x7f\x85"}) == r'{"a": "\u00d7\u007f\u0085"}'


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
@pytest.mark.parametrize(
    "words",
    [
        "transport --help",
        "weather --visibility 20 --rain 5 --compare",
        "budget",
        "scenes list warehouse",
        "schema scene",
        "simulate ∂é.yaml -o x.h5",
        "simulate s.yaml -o x.h5 --seed é\udcff",
    ],
)
def test_terminals_without_these_characters_get_others(
    words: str, encoding: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    streams = [io.TextIOWrapper(io.BytesIO(), encoding) for _ in range(2)]
    monkeypatch.setattr("sys.stdout", streams[0])
    monkeypatch.setattr("sys.stderr", streams[1])
    monkeypatch.setattr("sys.argv", ["spisim", *words.split()])
    monkeypatch.setattr("warnings.showwarning", None)
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == (2 if "x.h5" in words else 0)
    for stream in streams:
        stream.flush()
    text = b"".join(stream.buffer.getvalue() for stream in streams)  # type: ignore[attr-defined]
    assert text.decode(encoding)
    assert b"Error" not in text.replace(b"Error -", b"").replace(b"- Error", b"")


def test_a_program_writes_to_an_ascii_terminal(tmp_path: Path) -> None:
    variables = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "COLUMNS": "80"}
    for module, words in {
        "spisim": ["evaluate", "×.h5"],
        "reconstruction": ["×é.h5", "-o", "out"],
    }.items():
        run = subprocess.run(
            [sys.executable, "-m", module, *words],
            env=variables,
            cwd=tmp_path,
            capture_output=True,
            check=False,
        )
        assert run.returncode == 2
        assert b"no such capture file" in run.stderr
        assert run.stderr.isascii()
