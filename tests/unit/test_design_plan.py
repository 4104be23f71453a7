"""Plans of designs, and instruments within the limits of their base."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spisim
from designs import loaded
from reconstruction import InputError
from spisim_inverse.design.bench import Bench
from spisim_inverse.design.plan import Allowed, PlannedDesign, weather_of
from spisim_inverse.design.run import check_names
from spisim_inverse.design.space import Point, Space


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench(spisim.load_instrument("fog"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"choose": {"tof.times": {"low": [1, 1], "high": [0.1, 2]}}}, "low 1 is above high 0.1"),
        ({"choose": {"tof.times": {"low": 1, "high": 1}}}, "nothing to choose"),
        ({"choose": {"tof.times": {"low": [1, 1], "high": 2}}}, "should agree"),
        ({"choose": {"tof.times": {"low": "a", "high": 2}}}, "number or a list of numbers"),
        ({"choose": {"tof.times": {"low": 1}}}, "either values, or low and high"),
        ({"choose": {"tof.times": {"values": [1, 2], "step": 1}}}, "step is only for low"),
        ({"objectives": ["range_eror_m"]}, "did you mean 'range_error_m'"),
        ({"objectives": ["range_error_m"] * 2}, "range_error_m is repeated"),
        ({"at_most": {"range_rmse_m": 1}}, "range_rmse_m is not among the objectives"),
        ({"weathers": {"x": {"fogg": {}}}}, "did you mean 'fog'"),
        ({"judgement": [{"scene": "target-plane"}]}, "target-plane is also in search"),
        (
            {"search": [{"family": "warehouse"}], "judgement": [{"family": "warehouse"}]},
            "warehouse is also in search",
        ),
        ({"search": [{"family": "warehose"}]}, "did you mean 'warehouse'"),
        ({"search": [{"family": "warehouse", "parameters": {"aisle": 1}}]}, "'aisle_m'"),
        ({"search": [{"scene": "tunnel", "family": "rubble"}]}, "either scene or family"),
        ({"search": [{"scene": "tunnel", "count": 2}]}, "only for a family"),
        ({"evaluation": 3}, "did you mean 'evaluations'"),
    ],
)
def test_bad_plans_name_field_and_what_is_allowed(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        loaded(tmp_path, **changes)


def test_weathers_clear_what_the_scene_has(tmp_path: Path) -> None:
    plan = loaded(tmp_path).plan
    assert weather_of(plan, "clear") == dict.fromkeys(("fog", "rain", "snow", "smoke"))
    assert weather_of(plan, "fog")["fog"] == {"visibility_m": 50}


def test_the_digest_is_of_all_that_the_search_depends_on(tmp_path: Path) -> None:
    before = loaded(tmp_path).digest
    assert loaded(tmp_path, evaluations=7).digest == before
    assert loaded(tmp_path, judgement=[{"scene": "tunnel"}]).digest == before
    assert loaded(tmp_path, search=[{"scene": "tunnel"}]).digest != before
    assert loaded(tmp_path, draws=7).digest != before


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("tof.modulation.lights", "did you mean 'light'"),
        ("laser_fractions", "did you mean 'laser_fraction'"),
        ("laserss.power_w", "did you mean 'lasers'"),
        ("lasers.power_w.x", "no section before 'x'"),
    ],
)
def test_unknown_parameters_get_the_nearest_name(bench: Bench, name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        bench.check_name(name)


def test_a_bundle_needs_known_fields(tmp_path: Path, bench: Bench) -> None:
    def named(field: str) -> PlannedDesign:
        values = [{"tof.detector.field_of_view_deg": 0.5}, {field: 0.8}]
        return loaded(tmp_path, choose={"narrow": {"values": values}})

    check_names(named("tof.detector.field_of_view_deg"), bench)
    with pytest.raises(InputError, match="did you mean 'field_of_view_deg'"):
        check_names(named("tof.detector.field_of_view"), bench)


def test_times_need_frequencies() -> None:
    with pytest.raises(InputError, match="no modulation frequencies"):
        Bench(spisim.load_instrument("fog-spad")).check_name("tof.times")


def test_a_frame_keeps_its_time_whatever_the_frequencies(bench: Bench) -> None:
    for values in (
        {"tof.times": [1, 2, 5]},
        {"tof.modulation.frequencies_hz": [20e6, 90e6, 200e6]},
        {"tof.modulation.frequencies_hz": [20e6, 200e6], "tof.times": [1, 3]},
    ):
        tof = bench.make(values).tof
        whole = bench.base.tof.frame_time_s
        assert tof.frame_time_s == pytest.approx(whole, rel=1e-4)
        assert tof.frame_time_s <= whole * (1 + 1e-6)
        if "tof.times" in values:
            times = np.array([tof.light_time_s(each) for each in tof.modulation.frequencies_hz])
            wanted = np.array(values["tof.times"]) / sum(values["tof.times"])
            assert times / times.sum() == pytest.approx(wanted, rel=1e-3)


def test_the_base_is_made_of_its_own_times(bench: Bench) -> None:
    same = bench.make({"tof.times": bench.start("tof.times")})
    assert list(same.tof.periods) == pytest.approx(list(bench.base.tof.periods), abs=1)


def test_patterns_share_the_frame_time(bench: Bench) -> None:
    instrument = bench.make({"plan.patterns": 255})
    assert instrument.pattern_plan.exposures == 256
    assert instrument.frame_time_s == pytest.approx(bench.base.frame_time_s)
    assert instrument.exposure_time_s == pytest.approx(bench.base.exposure_time_s / 2)


def test_power_is_split(bench: Bench) -> None:
    split = bench.make({"laser_fraction": 0.003})
    total = 4 * split.lasers.power_w + split.projector.power_w
    assert total == pytest.approx(4 * bench.base.lasers.power_w + bench.base.projector.power_w)
    assert 4 * split.lasers.power_w == pytest.approx(0.003 * total)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"lasers.power_w": 0.02, "projector.power_w": 6.0}, "laser class is 3R; at most 1"),
        ({"lasers.power_w": 0.02}, "emitted power"),
        ({"tof.periods": [85200, 170400, 681600]}, "time of the ranges"),
        ({"projector.pattern_rate_hz": 7e3}, "frame time"),
        ({"tof.detector.field_of_view_deg": 0.3}, "lens of tof.detector"),
        ({"tof.modulation.frequencies_hz": [15e6, 60e6, 9.8e9]}, "at most 9.54"),
        ({"tof.times": [1, 1]}, "2 numbers for 3 frequencies"),
        ({"tof.times": [0, 0, 0]}, "not be negative nor all 0"),
        ({"laser_fraction": 1.5}, "between 0 and 1"),
        ({"plan.patterns": 9999}, "patterns"),
    ],
)
def test_instruments_stay_within_the_limits(
    bench: Bench, values: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        bench.make(values)


def test_a_larger_lens_may_be_allowed() -> None:
    wide = Bench(spisim.load_instrument("fog"), max_aperture_mm=40)
    assert wide.make({"tof.detector.field_of_view_deg": 0.3}).tof.detector.field_of_view_deg == 0.3


def test_points_and_values_agree(tmp_path: Path, bench: Bench) -> None:
    choose = {
        "tof.times": {"low": [0.1, 0.1, 0.1], "high": [1, 1, 1]},
        "plan.patterns": {"low": 63, "high": 255, "step": 16},
        "plan.order": {"values": ["cake-cutting", "sequency-2d"]},
    }
    space = Space(loaded(tmp_path, choose=choose).plan.choose)
    assert space.size == 4
    start = space.values(space.of_base(bench))
    assert start == {"tof.times": [1, 1, 1], "plan.patterns": 128, "plan.order": "sequency-2d"}
    rng = np.random.default_rng(0)
    for _ in range(20):
        values = space.values(Point(tuple(rng.random(4)), (("plan.order", 0),)))
        assert values["plan.patterns"] % 16 == 0 or values["plan.patterns"] in (63, 255)
        assert space.values(space.point(values)) == values


def test_probes_change_one_parameter(tmp_path: Path, bench: Bench) -> None:
    space = Space(loaded(tmp_path).plan.choose)
    start = space.of_base(bench)
    for name in space.choices:
        others = [space.values(each) for each in space.probes(start, name)]
        assert any(each[name] != space.values(start)[name] for each in others)
        for each in others:
            assert {n: v for n, v in each.items() if n != name} == {
                n: v for n, v in space.values(start).items() if n != name
            }


@pytest.mark.parametrize(
    ("end", "expected"),
    [(1.23456789e-3, 1.23457e-3), (-123456789.0, -123457000.0), (0.0, 0.0), (9.999999, 10.0)],
)
def test_values_have_six_digits(end: float, expected: float) -> None:
    space = Space({"x": Allowed(low=end, high=end + 1e9)})
    assert space.values(Point((0.0,), ()))["x"] == pytest.approx(expected, rel=1e-12)
