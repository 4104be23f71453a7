"""The benchmark that holds the simulator against measurements: its folder, smoke and raindrops."""

import json
import sys
from pathlib import Path

import measured
import measured_drops
import measured_folder
import measured_smoke
import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.atmosphere.fall_speed import LABORATORY_KG_PER_M3, terminal_speed_m_s
from spisim.atmosphere.rain import RAINS

VISIBILITIES_M = np.array([40.0, 60.0, 100.0])
WAVELENGTHS_NM = (1550, 1270)
SETS = ["--only", "smoke-tunnel", "--only", "raindrops"]


def save_smoke(folder: Path, factor: float = 1.0) -> None:
    """Attenuation as simulated, times a factor."""
    folder.mkdir(parents=True)
    columns = [factor * measured_smoke.attenuation(VISIBILITIES_M, nm) for nm in WAVELENGTHS_NM]
    rows = zip(VISIBILITIES_M, *columns, strict=True)
    lines = [f"visibility_m,{','.join(f'db_per_km_{nm}' for nm in WAVELENGTHS_NM)}"]
    lines += [",".join(f"{value:.6g}" for value in row) for row in rows]
    (folder / measured_smoke.FILE).write_text("\n".join(lines), encoding="utf-8")


def save_drops(folder: Path, slower: float = 1.0, blocks: int = 12) -> None:
    """Drops of Marshall & Palmer that fall as the law says, times a factor."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(0)
    decay = RAINS["marshall-palmer"].decay(5.0)
    lines = ["time_s,diameter_mm,fall_speed_m_s,oblateness,measuring_area_mm2"]
    air = measured_drops.air_density_kg_m3(measured_drops.ALTITUDE_M)
    for block in range(blocks):
        diameter = 0.35 + rng.exponential(1 / decay, 20_000)
        law = terminal_speed_m_s(diameter, air)
        passes = rng.random(diameter.size) < law / 12  # the faster, the more cross the area
        diameter, law = diameter[passes][:1500], law[passes][:1500]
        times = 60 * block + np.linspace(0, 59, diameter.size)
        speed = slower * law * rng.normal(1, 0.05, diameter.size)
        for row in zip(times, diameter, speed, strict=True):
            lines.append(f"{row[0]:.1f},{row[1]:.3f},{row[2]:.3f},1,10000")
    (folder / "drops.csv").write_text("\n".join(lines), encoding="utf-8")


def run(monkeypatch, capsys, *options: str) -> tuple[int, dict, str]:
    monkeypatch.setattr(sys, "argv", ["measured.py", *options, "--json"])
    status = measured.main()
    printed = capsys.readouterr()
    return status, json.loads(printed.out.splitlines()[-1]), printed.err


def holds(report: dict) -> dict[str, bool | None]:
    return {check["name"]: check["holds"] for check in report["checks"]}


def test_the_sets_have_hashes():
    assert {path.partition("/")[0] for path in measured_folder.hashes()} >= {
        each.folder for each in measured.all_sets()
    }
    assert all(len(digest) == 64 for digest in measured_folder.hashes().values())


def test_other_data_are_told_and_compared(tmp_path, monkeypatch, capsys):
    save_smoke(tmp_path / "smoke-tunnel")
    data = ["--data", str(tmp_path), *SETS]
    status, report, said = run(monkeypatch, capsys, *data, "--output", str(tmp_path / "page"))
    assert "smoke-tunnel/attenuation.csv has the hash" in said
    assert "raindrops: missing" in said
    states = {row["set"]: row[""] for row in report["tables"][0]["rows"]}
    assert states == {"smoke-tunnel": "holds", "raindrops": "not compared"}
    assert status == 0
    assert all(holds(report).values())
    page = (tmp_path / "page" / "index.md").read_text(encoding="utf-8")
    assert "![smoke-tunnel](measured-smoke-tunnel.png)" in page
    assert (tmp_path / "page" / "measured-smoke-tunnel.png").stat().st_size > 1000


def test_a_set_that_cannot_be_read_does_not_stop_the_others(tmp_path, monkeypatch, capsys):
    save_smoke(tmp_path / "smoke-tunnel", factor=2.0)
    (tmp_path / "raindrops").mkdir()
    (tmp_path / "raindrops" / "drops.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    status, report, said = run(monkeypatch, capsys, "--data", str(tmp_path), *SETS)
    assert "raindrops: drops.csv is no table of drops" in said
    assert status == 1
    by_name = holds(report)
    name = "smoke-tunnel: fog-machine, mean deviation at 1550 nm of dB/km, 40 to 100 m"
    assert by_name[name] is False


def test_without_data_only_what_is_shipped_is_compared(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv(measured.DATA, raising=False)
    status, report, said = run(monkeypatch, capsys, *SETS)
    assert status == 1
    assert not report["checks"]
    assert "smoke-tunnel: missing" in said


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (["--data", "nowhere"], "no folder nowhere"),
        (["--only", "smoke-tunel"], "did you mean 'smoke-tunnel'"),
    ],
)
def test_mistaken_options_are_told(options, part, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["measured.py", *options])
    assert measured.main() == 1
    assert part in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("visibility_m,db_per_km_1550\n40,60\n", "db_per_km_1270"),
        ("visibility_m,db_per_km_1550,db_per_km_1270\n40,-60,90\n", "positive"),
        ("visibility_m,db_per_km_1550,db_per_km_1270\n40,sixty,90\n", "no table"),
        ("", "no table"),
    ],
)
def test_a_table_of_smoke_that_is_none_is_refused(tmp_path, text, part):
    path = tmp_path / "attenuation.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=part):
        measured_smoke.read(path)


def test_drops_that_fall_as_the_law_says_hold(tmp_path):
    save_drops(tmp_path / "drops")
    comparison = measured_drops.compare(tmp_path / "drops", quick=True)
    assert len(comparison.checks) == 4
    assert all(check.holds is not False for check in comparison.checks)
    deviations = [check.value for check in comparison.checks if "deviation of" in check.name]
    assert max(deviations) < 0.02
    law = RAINS["marshall-palmer"].decay(5.0)
    drops = measured_drops.read(tmp_path / "drops")
    assert np.median(measured_drops.slopes(drops)[1]) == pytest.approx(law, rel=0.05)


def test_a_law_that_is_wrong_everywhere_fails(tmp_path):
    save_drops(tmp_path / "drops", slower=0.8)
    comparison = measured_drops.compare(tmp_path / "drops", quick=True)
    by_name = {check.name: check.holds for check in comparison.checks}
    assert by_name["classes that deviate by more than 5 %, unexplained"] is False
    assert not all(by_name.values())


def test_air_is_thinner_higher_up():
    assert measured_drops.air_density_kg_m3(0.0) == pytest.approx(1.225)
    assert measured_drops.air_density_kg_m3(1000.0) == pytest.approx(1.112, rel=1e-3)
    thin, usual = terminal_speed_m_s(np.array(2.0), 0.6), terminal_speed_m_s(np.array(2.0))
    assert thin / usual == pytest.approx((LABORATORY_KG_PER_M3 / 0.6) ** 0.4)
