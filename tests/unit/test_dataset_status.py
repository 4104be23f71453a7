"""How far a data set is, its contact sheet, and the commands for both."""

import fcntl
import json
import os
import re
import shutil
from base64 import b64decode
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

import spisim.dataset
from datasets import change, make_set, sample_capture
from reconstruction import Capture, InputError, write_capture
from spisim.dataset.cost import Cost
from spisim.dataset.status import status_of
from spisim_app.cli import app
from spisim_app.cli.dataset import PlanOrCommand
from spisim_app.report.contact_sheet import evenly, write_contact_sheet


@pytest.fixture(scope="module")
def folder(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_set(tmp_path_factory.mktemp("sets") / "walls", capture, done=21, failed=4)


@pytest.fixture
def own(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "walls"))


def run(*arguments: object) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["dataset", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


def test_samples_are_counted_and_failures_grouped(folder: Path) -> None:
    status = status_of(folder)
    assert (status.name, status.planned) == ("walls", 27)
    assert (status.done, status.failed, status.missing) == (21, 4, 2)
    assert status.failures == {
        "a laser hits nothing": [21, 23],
        "scene #: drone within # cm": [22, 24],
    }
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert status.disk_bytes == sum(len(path.read_bytes()) for path in files)


def test_the_rate_is_that_of_the_last_ten_minutes(own: Path) -> None:
    change(own, "DELETE FROM samples WHERE status = 'failed'")
    assert status_of(own).samples_per_minute == pytest.approx(1)
    change(own, "UPDATE samples SET finished = '2026-01-01T00:20:30+00:00' WHERE \"index\" = 19")
    change(own, 'DELETE FROM samples WHERE "index" NOT IN (3, 19, 20)')
    change(own, "UPDATE samples SET finished = '2026-01-01T00:20:00+00:00' WHERE \"index\" = 20")
    assert status_of(own).samples_per_minute == pytest.approx(2)
    change(own, 'DELETE FROM samples WHERE "index" = 20')
    assert status_of(own).samples_per_minute is None
    change(own, "DELETE FROM samples")
    assert status_of(own).samples_per_minute is None


def test_a_run_under_way_is_told_and_a_killed_one_is_not(own: Path) -> None:
    lock = own / ".lock"
    assert status_of(own).runner is None
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.write(f"{os.getpid()} here")
        file.flush()
        assert status_of(own).runner == f"{os.getpid()} on here"
        assert "on here is making samples" in run("verify", own)[2].replace("\n", " ")
    assert lock.read_text()  # as a killed run leaves it
    assert status_of(own).runner is None


def test_status_is_told_to_people_and_programs(own: Path) -> None:
    change(own, "UPDATE samples SET error = 'objects[3] is [gone]' WHERE \"index\" = 21")
    code, text, _ = run("status", own)
    assert code == 0
    assert re.search(r"done +21\n +failed +4\n +missing +2\n", text)
    assert "objects[#] is [gone]" in text
    code, text, _ = run("status", own, "--json")
    assert code == 0
    assert json.loads(text)["missing"] == 2
    assert json.loads(text)["failures"]["scene #: drone within # cm"] == [22, 24]


def test_the_slowest_samples_are_reported(own: Path, tmp_path: Path) -> None:
    change(own, 'UPDATE samples SET seconds = 1 + "index"')
    compiling = """seconds = 120, stage_seconds = '{"compile": 90}'"""
    change(own, f'UPDATE samples SET {compiling} WHERE "index" = 3')
    compiling = """seconds = 206, stage_seconds = '{"compile": 200}'"""
    change(own, f'UPDATE samples SET {compiling} WHERE "index" = 5')  # as fast as it was
    status = status_of(own)
    assert [record.index for record in status.slowest] == [3, 20, 19, 18, 17]
    assert status.cost == Cost(21, 12.0, 20.0, 30.0, pytest.approx((231 - 4 + 30) / 21))
    _, text, _ = run("status", own)
    assert re.search(r"median 12\.00 s, 90 % within 20\.00 s, at most 30\.00 s", text)
    assert re.search(r"30\.00 +90\.00 +3 +power_w: 0\.3 +\n", text)
    _, text, _ = run("status", own, "--json")
    assert json.loads(text)["slowest"][0]["seconds"] == 120
    assert json.loads(text)["cost"]["max_s"] == 30
    write_contact_sheet(tmp_path / "sheet.html", spisim.dataset.open(own), 1)
    heads = r'<td data-head="sample">3</td><td data-head="seconds">30.00</td>'
    assert heads in read(tmp_path)
    change(own, "UPDATE samples SET seconds = NULL")
    assert "median" not in run("status", own)[1]
    write_contact_sheet(tmp_path / "sheet.html", spisim.dataset.open(own), 1)
    assert "Slowest samples" not in read(tmp_path)


def test_verify_says_by_its_exit_status_whether_all_is_well(own: Path) -> None:
    assert run("verify", own)[0] == 0
    assert json.loads(run("verify", own, "--json")[1]) == {"sound": True, "findings": []}
    (own / "samples/000/000004.h5").unlink()
    code, text, _ = run("verify", own)
    assert code == 1
    assert re.search(r"samples/000/000004\.h5 +missing +of sample 4", text)
    code, text, _ = run("verify", own, "--json")
    assert code == 1
    assert json.loads(text)["findings"] == [
        {"file": "samples/000/000004.h5", "problem": "missing", "detail": "of sample 4"}
    ]


@pytest.mark.parametrize("command", ["status", "verify", "export", "sheet"])
def test_a_folder_that_is_no_data_set_ends_with_two(tmp_path: Path, command: str) -> None:
    more = {"export": ["-o", tmp_path / "out"], "sheet": ["-o", tmp_path / "out.html"]}
    code, _, text = run(command, tmp_path, *more.get(command, []))
    assert code == 2
    assert "not a data set" in text
    assert not list(tmp_path.iterdir())


def test_shards_are_exported(folder: Path, tmp_path: Path) -> None:
    code, text, _ = run("export", folder, "-o", tmp_path, "--shard-size", 20, "--json")
    assert code == 0
    assert json.loads(text)["samples"] == 21
    assert len(list(tmp_path.glob("*.tar"))) == 2
    assert run("export", folder, "-o", tmp_path, "--format", "zip")[0] == 2
    assert run("export", folder, "-o", tmp_path, "--shard-size", 0)[0] == 2


def test_a_plan_in_place_of_a_command_is_run(tmp_path: Path) -> None:
    ran: list[str] = []
    group = typer.Typer(cls=PlanOrCommand)
    group.command("run")(lambda plan, output="": ran.append(plan))
    group.command("status")(lambda folder: ran.append(f"status of {folder}"))
    (tmp_path / "plan").touch()
    for first in ("plan.yaml", "no/such.yml", str(tmp_path / "plan")):
        assert CliRunner().invoke(group, [first]).exit_code == 0
        assert ran[-1] == first
    assert CliRunner().invoke(group, ["run", "x.yaml"]).exit_code == 0
    assert CliRunner().invoke(group, ["status", "plan.yaml"]).exit_code == 0
    assert ran[-2:] == ["x.yaml", "status of plan.yaml"]
    mistyped = CliRunner().invoke(group, ["statsu", "folder"])
    assert mistyped.exit_code == 2
    assert "Did you mean 'status'" in mistyped.stderr
    assert CliRunner().invoke(group, ["--help"]).exit_code == 0


def test_options_may_stand_before_the_plan(tmp_path: Path) -> None:
    code, _, text = run("-o", tmp_path / "out", tmp_path / "plan.yaml")
    assert code == 2
    assert "plan.yaml: no such file" in text


@pytest.mark.parametrize(
    ("count", "limit", "positions"),
    [(5, 100, [0, 1, 2, 3, 4]), (101, 3, [0, 50, 100]), (10, 1, [0]), (1, 1, [0])],
)
def test_samples_are_chosen_evenly(count: int, limit: int, positions: list[int]) -> None:
    assert evenly(count, limit) == positions


def test_the_sheet_is_one_page_of_pictures_and_words(folder: Path, tmp_path: Path) -> None:
    data, fractions = spisim.dataset.open(folder), []
    assert write_contact_sheet(tmp_path / "sheet.html", data, 5, fractions.append) == 5
    assert fractions[-1] == 1
    page = (tmp_path / "sheet.html").read_text()
    assert page.count('src="data:image/png;base64,') == 15
    assert "://" not in page
    assert "url(" not in page
    assert re.findall(r"<h3>(.*?)<small>(\d+)", page) == [
        (f"walls-{k % 20}", str(k)) for k in (0, 5, 10, 15, 20)
    ]
    assert "21 samples of 20 scenes, 4 failed; 5 of them here" in page
    assert "<dt>fog.visibility_m</dt><dd>60</dd>" in page
    assert page.count("<dt>scene</dt><dd>walls</dd>") == 1  # what all share is told once
    assert "clear air" in page


def test_the_sheet_tells_the_error_of_the_depth_map(own: Path, tmp_path: Path) -> None:
    """The wall of sample 20 is said to be 20 m farther away than what was recorded of it."""
    write_contact_sheet(tmp_path / "sheet.html", spisim.dataset.open(own).select([0, 20]))
    near, far = re.findall(r"<b>([\d.]+) (?:cm|m)</b> mean depth error", read(tmp_path))
    assert float(far) == pytest.approx(20, abs=1)
    assert float(near) < 100  # centimetres


def test_every_sample_has_a_depth_scale_of_its_own(
    own: Path, tmp_path: Path, capture: Capture
) -> None:
    """The walls of a room keep their colours beside a street ten times as deep."""
    assert capture.truth is not None
    depth_m = np.linspace(2, 5, capture.truth.depth_m.size).reshape(capture.truth.depth_m.shape)
    for index, times in ((0, 1), (1, 10)):
        truth = replace(capture.truth, depth_m=times * depth_m.astype(np.float32))
        write_capture(replace(capture, truth=truth), own / f"samples/000/{index:06d}.h5")
    write_contact_sheet(tmp_path / "sheet.html", spisim.dataset.open(own)[:2])
    addresses = re.findall(r'src="data:image/png;base64,([^"]+)"', read(tmp_path))
    assert len(addresses) == 6  # image, estimated and true depth of two samples
    for true_depth in (addresses[2], addresses[5]):
        colours = np.asarray(Image.open(BytesIO(b64decode(true_depth)))).reshape(-1, 4)
        assert len(np.unique(colours, axis=0)) > 100
    assert read(tmp_path).count('class="scale"') == 2


def read(folder: Path) -> str:
    return (folder / "sheet.html").read_text()


def test_the_sheet_tells_the_weather(own: Path, tmp_path: Path, capture: Capture) -> None:
    media = "media: [{where: air, kind: haze <h>, visibility_m: 150.0}, {where: volume plume}]"
    foggy = replace(capture, provenance=replace(capture.provenance, settings=media))
    write_capture(foggy, own / "samples/000/000000.h5")
    write_contact_sheet(tmp_path / "sheet.html", spisim.dataset.open(own)[:1])
    assert "haze &lt;h&gt;, 150 m; volume plume" in read(tmp_path)


def test_captures_that_cannot_be_used_are_told_on_the_sheet(
    own: Path, tmp_path: Path, capture: Capture
) -> None:
    blind = replace(capture.buckets, saturated=~capture.buckets.saturated)
    write_capture(replace(capture, buckets=blind), own / "samples/000/000000.h5")
    (own / "samples/000/000001.h5").write_bytes(b"no HDF5")
    bare = replace(sample_capture(capture, 2), truth=None, spots=None)
    write_capture(bare, own / "samples/000/000002.h5")
    write_contact_sheet(tmp_path / "sheet.html", spisim.dataset.open(own)[:3])
    page = read(tmp_path)
    assert "every pattern has a saturated reading" in page
    assert "000001.h5: not an HDF5 file" in page
    assert "no estimated depth" in page
    assert "no true depth" in page


def test_a_sheet_that_cannot_be_is_refused(own: Path, tmp_path: Path) -> None:
    data = spisim.dataset.open(own)
    with pytest.raises(InputError, match="no finished samples to show"):
        write_contact_sheet(tmp_path / "sheet.html", data[:0])
    with pytest.raises(InputError, match="is a folder"):
        write_contact_sheet(own, data)


def test_the_command_says_where_to_look(folder: Path, tmp_path: Path) -> None:
    code, _, text = run("sheet", folder, "-o", tmp_path / "sheet.html", "--limit", 2)
    assert code == 0
    assert (tmp_path / "sheet.html").as_uri() in text.replace("\n", "")
    code, text, _ = run("sheet", folder, "-o", tmp_path / "sheet.html", "--limit", 2, "--json")
    assert json.loads(text)["samples"] == 2
