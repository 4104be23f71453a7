"""The paper's results come out as far as they can, and the command says so."""

import json
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from commands import spisim
from spisim.instrument import load_instrument
from spisim_paper import table2
from spisim_paper.fig2 import LIGHTS, figure_2, fit_total_count, total_count_max_range
from spisim_paper.fig3 import figure_3, max_ranges
from spisim_paper.table2 import PAPER, measure, table_2


def test_figure_2_by_total_count() -> None:
    fraction = fit_total_count()
    assert fraction == pytest.approx((0.03056, 0.0224), rel=2e-3)
    assert total_count_max_range(*fraction) == pytest.approx([2.77, 5.08, 7.96], rel=2e-3)


def test_lights_of_figure_2_are_those_of_the_paper() -> None:
    """6.4 W as in Table 1, or four times as much; half or full angle."""
    power_w = load_instrument("paper").imaging.projector.power_w
    assert tuple((n * power_w, angle) for n in (1, 4) for angle in (10.0, 20.0)) == LIGHTS


def test_checks_of_figure_2_hold() -> None:
    checks = {check.name: check for check in figure_2().checks}
    assert set(checks) == {"fig2_physical_deviation", "fig2_total_count_deviation"}
    assert all(check.holds for check in checks.values())


def test_figure_3_without_an_amplifier() -> None:
    """Eq. (3) as printed, from 100 klx on the darkest to 15 klx on the brightest target."""
    thousand, ten_thousand = max_ranges("PIN", 0.0)
    outdoors = [thousand[3, 0], thousand[2, 2], ten_thousand[3, 0], ten_thousand[2, 2]]
    assert outdoors == pytest.approx([3.4, 5.7, 6.2, 10.4], rel=0.05)
    indoors = [thousand[1, 0], thousand[0, 2], ten_thousand[1, 0], ten_thousand[0, 2]]
    assert indoors == pytest.approx([4.3, 7.5, 8.2, 14.0], rel=0.1)


def test_figure_3_with_an_amplifier() -> None:
    thousand, ten_thousand = max_ranges("PIN", 2e-12)
    assert ten_thousand[:, 0] == pytest.approx(0.81, rel=0.01)
    assert ten_thousand[:, 2] == pytest.approx(1.62, rel=0.01)
    assert thousand[:, [0, 2]] == pytest.approx(np.full((4, 2), [0.46, 0.91]), rel=0.01)
    thousand, ten_thousand = max_ranges("APD", 2e-12)
    assert [ten_thousand[3, 0], ten_thousand[2, 2]] == pytest.approx([2.5, 4.8], rel=0.02)
    assert [thousand[3, 0], thousand[2, 2]] == pytest.approx([1.35, 2.6], rel=0.02)


def test_checks_of_figure_3_hold() -> None:
    checks = figure_3().checks
    assert len(checks) == 5
    assert all(check.holds for check in checks)


def test_projection_times_of_table_2() -> None:
    times = [1e3 * row.projection_s for row in PAPER]
    assert times == pytest.approx([8.53, 2.13, 4.27, 8.53], abs=5e-3)


def test_a_frame_is_reconstructed_in_some_time() -> None:
    assert 0 < measure(PAPER[1], repetitions=3) < 1


def test_frame_rates_of_a_slow_machine_are_told_and_not_judged(monkeypatch) -> None:
    """They are measured, and a busy machine is no fault of anybody's."""
    monkeypatch.setattr(table2, "measure", lambda row: 10.0)
    result = table_2()
    assert result.checks == ()
    assert [row[5] for row in result.tables[0].rows] == ["-100 %"] * len(PAPER)


def test_where_nothing_is_promised_no_table_says_so(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(table2, "measure", lambda row: 10.0)
    run = spisim("paper", "table2", "-o", tmp_path / "figures")
    assert run.exit_code == 0, run.stderr
    assert "frames/s" in run.stdout
    assert "promised" not in run.stdout


def test_paper_draws_and_checks(tmp_path: Path) -> None:
    run = spisim("paper", "fig2", "-o", tmp_path / "figures", "--json")
    assert run.exit_code == 0, run.stderr
    report = json.loads(run.stdout)
    keys = ("name", "value", "interval", "limit", "holds")
    assert {tuple(check) for check in report["checks"]} == {keys}
    assert all(check["holds"] for check in report["checks"])
    assert "No single T_int" in " ".join(run.stdout.split())
    picture = tmp_path / "figures" / "fig2.png"
    assert report["written"] == [str(picture)]
    assert matplotlib.image.imread(picture).shape[1] > 1000


def test_paper_pastes_its_tables(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- paper -->\nold\n<!-- /paper -->\nafter\n")
    run = spisim("paper", "fig3", "-o", tmp_path, "--markdown", page)
    assert run.exit_code == 0, run.stderr
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "\nold\n" not in text
    assert "| PIN | outdoors | 0.8 to 1.7 |" in text
    assert "0.8 to 1.7" in run.stdout
    assert '"checks"' not in run.stdout  # for people


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["fig4"], "fig4"),
        (["fig2", "-o", "{page}"], "not a folder"),
        (["fig2", "-o", "{folder}", "--markdown", "{page}"], "marks"),
        (["fig2", "-o", "{folder}", "--markdown", "{folder}/missing.md"], "missing.md"),
    ],
)
def test_mistakes_of_the_command_line(tmp_path: Path, arguments: list[str], part: str) -> None:
    page = tmp_path / "page.md"
    page.write_text("no marks")
    run = spisim("paper", *(a.format(page=page, folder=tmp_path) for a in arguments))
    assert run.exit_code == 2
    assert "Traceback" not in run.stderr
    assert part in run.stderr
    assert not (tmp_path / "fig2.png").exists()
