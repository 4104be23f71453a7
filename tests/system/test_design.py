"""A design from its plan to the page, interrupted and resumed; and the light that it shares."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import spisim
from designs import loaded
from reconstruction import InputError
from spisim.simulation.light import solve
from spisim_app.cli import app
from spisim_inverse.design.archive import FILE
from spisim_inverse.design.bench import Bench
from spisim_inverse.design.cases import make_cases
from spisim_inverse.design.light import TracedLight, optics_of
from spisim_inverse.design.measuring import LIGHT
from spisim_inverse.design.objectives import OBJECTIVES
from spisim_inverse.design.run import INSTRUMENT, PAGE
from spisim_inverse.design.sampling import BOUNDS, RANGES, sample

SMALL: dict[str, Any] = {
    "search": [{"scene": "target-plane"}],
    "judgement": [{"scene": "target-tilted-plane"}],
    "weathers": {"fog": {"fog": {"visibility_m": 50}}},
    "choose": {"tof.times": {"low": [0.1, 0.1, 0.1], "high": [1, 1, 1]}},
    "evaluations": 6,
    "spp": 1,
}


def quiet(fraction: float) -> None:
    return None


def design(plan: Path, folder: Path) -> Any:
    return CliRunner().invoke(app, ["design", str(plan), "-o", str(folder), "--json"])


def test_a_design_is_written_and_resumed(tmp_path: Path) -> None:
    plan, folder = loaded(tmp_path, **SMALL).path, tmp_path / "out"
    first = design(plan, folder)
    assert first.exit_code == 0, first.output
    summary = json.loads(first.stdout.splitlines()[-1])
    instrument = spisim.load_instrument(folder / INSTRUMENT)
    base = spisim.load_instrument("fog")
    assert instrument.frame_time_s == base.frame_time_s
    assert instrument.tof.frame_time_s <= base.tof.frame_time_s * (1 + 1e-6)
    assert "target-tilted-plane" in (folder / PAGE).read_text()

    lines = (folder / FILE).read_text().splitlines()
    assert len(lines) >= 1 + SMALL["evaluations"]
    (folder / FILE).write_text("\n".join(lines[:4]) + "\n")  # as if killed
    (folder / INSTRUMENT).unlink()
    lit = sorted(path.name for path in (folder / LIGHT).iterdir())
    again = design(plan, folder)
    assert json.loads(again.stdout.splitlines()[-1]) == summary
    assert (folder / FILE).read_text().splitlines() == lines
    assert sorted(path.name for path in (folder / LIGHT).iterdir()) == lit

    other = design(loaded(tmp_path, **{**SMALL, "draws": 3}).path, folder)
    assert other.exit_code == 2
    assert "another plan" in other.output


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"judgement": [{"scene": "nowhere"}]}, "judgement: "),
        ({"choose": {"tof.tims": {"low": 1, "high": 2}}}, "choose: tof.tims"),
        ({"max_range_m": 1e-3}, "no spot within"),
    ],
)
def test_a_plan_is_checked_before_its_folder_holds_a_search(
    changes: Any, message: str, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    refused = design(loaded(tmp_path, **{**SMALL, **changes}).path, folder)
    assert refused.exit_code == 2
    assert message in refused.stderr
    assert not (folder / FILE).exists()


def test_light_is_that_of_any_powers_frequencies_and_patterns(tmp_path: Path) -> None:
    planned = loaded(tmp_path, **SMALL)
    bench = Bench(planned.instrument)
    other = bench.make(
        {"laser_fraction": 0.004, "tof.times": [1, 1, 4], "plan.order": "cake-cutting"}
    )
    assert optics_of(other) == optics_of(bench.base)
    scene = make_cases(planned, "search")[0].scene
    one, two = (solve(scene, each, spp=1, seed=3) for each in (bench.base, other))
    assert np.array_equal(one.image, two.image)
    assert np.array_equal(one.spot_histogram, two.spot_histogram)
    assert np.array_equal(one.spot_daylight_w, two.spot_daylight_w)
    power = other.mean_powers_w.sum() / bench.base.mean_powers_w.sum()
    off = two.spot_crosstalk_w - power * one.spot_crosstalk_w
    error = np.hypot(two.spot_crosstalk_error_w, power * one.spot_crosstalk_error_w)
    assert np.all(np.abs(off) <= 4 * error + 0.05 * two.spot_crosstalk_w)


def test_other_optics_have_other_light() -> None:
    bench = Bench(spisim.load_instrument("fog"), max_aperture_mm=40)
    for values in (
        {"tof.detector.field_of_view_deg": 0.5},
        {"lasers.divergence_mrad": 2.0},
        {"projector.fov_deg": 24},
    ):
        assert optics_of(bench.make(values)) != optics_of(bench.base)
    turned = bench.make({"lasers.directions_deg": [[-4, 5], [5, 5], [-5, -5], [5, -5]]})
    assert optics_of(turned) != optics_of(bench.base)
    assert optics_of(turned, directions=False) == optics_of(bench.base, directions=False)


def test_damaged_light_is_reported(tmp_path: Path) -> None:
    planned = loaded(tmp_path, **SMALL)
    cases = make_cases(planned, "search")
    TracedLight(cases, tmp_path, 1, 0).of(planned.instrument, quiet)
    kept = sorted(tmp_path.glob("*.npz"))
    kept[0].write_bytes(kept[0].read_bytes()[:100])
    kept[1].write_bytes(kept[1].read_bytes()[:100])
    with pytest.raises(InputError, match=r"not readable .* remove it"):
        TracedLight(cases, tmp_path, 1, 0).of(planned.instrument, quiet)


def test_errors_are_those_that_the_bound_states(tmp_path: Path) -> None:
    """On a plane in fog the default method reaches the bound: χ² of many draws by z-score."""
    planned = loaded(tmp_path, **SMALL)
    instrument = planned.instrument
    lit = TracedLight(make_cases(planned, "search"), tmp_path, 4, 0).of(instrument, quiet)
    draws = 60
    (one,) = sample(instrument, lit, {RANGES, BOUNDS}, max_range_m=10, draws=draws, seed=1)
    assert one.counts.all()
    assert np.isfinite(one.error_m).all()
    ratio = np.sqrt((one.error_m.var(axis=0, ddof=1) / one.bound_m**2).mean())
    assert 0.8 < ratio < 1.2  # 1 ± 0.05; light's own error moves the mean, not the scatter
    assert OBJECTIVES["range_bound_m"].of([one]) == pytest.approx(
        np.exp(np.log(one.bound_m).mean())
    )


def test_bounds_are_of_even_fog(tmp_path: Path) -> None:
    planned = loaded(tmp_path, **SMALL)
    lit = TracedLight(make_cases(planned, "search"), tmp_path, 1, 0).of(planned.instrument, quiet)
    volume = object()
    scene = replace(lit[0].case.scene, volumes=(volume,))
    patchy = replace(lit[0], case=replace(lit[0].case, scene=scene))
    with pytest.raises(InputError, match="has volumes"):
        sample(planned.instrument, [patchy], {BOUNDS}, max_range_m=10, draws=1, seed=1)
