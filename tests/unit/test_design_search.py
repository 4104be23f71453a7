"""Searches of instruments: they find minima, respect limits, and replay."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from designs import loaded
from reconstruction import InputError
from spisim_inverse.design.archive import FILE, Archive, Evaluation
from spisim_inverse.design.judgement import WITH_A_RANGE, WRONG, Pairs, compared, judge
from spisim_inverse.design.objectives import LIMIT_M, OBJECTIVES, figure, over_weathers
from spisim_inverse.design.plan import Allowed, PlannedDesign
from spisim_inverse.design.sampling import Sample
from spisim_inverse.design.search import Search, front
from spisim_inverse.design.space import Point, Space

CHOICES = {
    "x": Allowed(low=[0.0, 0.0], high=[1.0, 2.0]),
    "kind": Allowed(values=("bad", "good", "worse")),
}
OFFSET = {"bad": 1.0, "good": 0.0, "worse": 2.0}


def bowl(values: Mapping[str, Any]) -> Evaluation:
    """Smallest at (0.3, 1.4), good; impossible beyond 1.8."""
    x, y = values["x"]
    if y > 1.8:
        return Evaluation(values, None, reason="too large")
    size = 1 + (x - 0.3) ** 2 + (y - 1.4) ** 2 + OFFSET[values["kind"]]
    return Evaluation(values, {"a": size, "b": 1 + (x - 0.8) ** 2 + OFFSET[values["kind"]]})


def searched(objectives: tuple[str, ...] = ("a",), evaluations: int = 150) -> list[Evaluation]:
    base = dict.fromkeys(objectives, 2.0)
    search = Search(Space(CHOICES), objectives, base, bowl, evaluations, seed=1)
    return search.run(Point((0.9, 0.1), (("kind", 0),)))


def best(evaluations: list[Evaluation], name: str) -> Evaluation:
    return min(evaluations, key=lambda each: each.figures[name])


def test_a_search_reaches_the_minimum_within_its_evaluations() -> None:
    made = searched()
    assert len(made) <= 150
    lowest = best(made, "a")
    assert lowest.values["kind"] == "good"
    assert lowest.values["x"] == pytest.approx([0.3, 1.4], abs=0.05)


def test_a_search_stays_below_limits() -> None:
    space = Space(CHOICES)
    base = {"a": 2.0, "b": 1.1}
    search = Search(space, ("a", "b"), base, bowl, 200, 1, {"b": 1.0})
    made = search.run(Point((0.9, 0.1), (("kind", 0),)))
    within = [each for each in made if each.figures["b"] <= 1.1]
    assert best(within, "a").values["x"] == pytest.approx([0.8 - 0.1**0.5, 1.4], abs=0.07)
    ranked = sorted(made, key=lambda each: search.score(each, np.array([0.9, 0.1])))
    assert ranked[0].figures["b"] <= 1.1 * 1.01


def test_a_search_is_deterministic() -> None:
    assert searched() == searched()


def test_the_front_is_of_those_that_none_beats() -> None:
    made = searched(("a", "b"))
    figures = np.array([[each.figures["a"], each.figures["b"]] for each in made])
    kept = front(made, ("a", "b"))
    assert len(kept) > 3
    for each in kept:
        one = np.array([each.figures["a"], each.figures["b"]])
        assert not ((figures <= one).all(axis=1) & (figures < one).any(axis=1)).any()
    assert [each.figures["a"] for each in kept] == sorted(each.figures["a"] for each in kept)
    assert best(made, "a").values["x"][0] == pytest.approx(0.3, abs=0.1)
    assert best(made, "b").values["x"][0] == pytest.approx(0.8, abs=0.1)


def test_a_search_without_any_instrument_names_the_reason() -> None:
    def impossible(values: Mapping[str, Any]) -> Evaluation:
        return Evaluation(values, None, reason="the laser class is 3B; at most 1, as of the base")

    search = Search(Space(CHOICES), ("a",), {"a": 1.0}, impossible, 10, seed=1)
    with pytest.raises(InputError, match=r"none of 257 .* the laser class is 3B"):
        search.run(Point((0.5, 0.5), (("kind", 0),)))


def test_a_start_that_is_impossible_is_left() -> None:
    space = Space(CHOICES)
    made = Search(space, ("a",), {"a": 1.0}, bowl, 20, seed=1).run(
        Point((0.5, 1.0), (("kind", 0),))
    )
    assert made


@pytest.mark.parametrize("name", ["x", "kind"])
def test_a_parameter_without_influence_is_reported(name: str) -> None:
    def blind(values: Mapping[str, Any]) -> Evaluation:
        return replace(bowl({**values, name: CHOICE_OF[name]}), values=values)

    search = Search(Space(CHOICES), ("a",), {"a": 1.0}, blind, 50, seed=1)
    with pytest.raises(InputError, match=f"choose.{name}: a do not depend on it"):
        search.run(Point((0.5, 0.5), (("kind", 0),)))


CHOICE_OF = {"x": [0.5, 0.5], "kind": "good"}


class TestArchive:
    def test_an_archive_is_read_again(self, tmp_path: Path) -> None:
        planned = loaded(tmp_path)
        one, none = Evaluation({"x": 1.0}, {"a": 2.0}), Evaluation({"x": 2.0}, None, reason="no")
        archive = Archive(tmp_path, planned)
        archive.add(one)
        archive.add(none)
        again = Archive(tmp_path, planned)
        assert again.get({"x": 1.0}) == one
        assert again.get({"x": 2.0}) == none
        assert again.get({"x": 3.0}) is None

    def test_half_a_line_of_a_killed_run_is_dropped(self, tmp_path: Path) -> None:
        planned = loaded(tmp_path)
        Archive(tmp_path, planned).add(Evaluation({"x": 1.0}, {"a": 2.0}))
        with (tmp_path / FILE).open("a") as file:
            file.write('{"values": {"x"')
        archive = Archive(tmp_path, planned)
        archive.add(Evaluation({"x": 2.0}, {"a": 3.0}))
        assert Archive(tmp_path, planned).get({"x": 2.0}).figures == {"a": 3.0}

    def test_another_plan_is_refused(self, tmp_path: Path) -> None:
        Archive(tmp_path, loaded(tmp_path)).add(Evaluation({"x": 1.0}, {"a": 2.0}))
        with pytest.raises(InputError, match=r"a search by another plan .* restore plan\.yaml"):
            Archive(tmp_path, loaded(tmp_path, draws=5))

    @pytest.mark.parametrize("size", [0, 1, 30])
    def test_a_beginning_of_a_killed_run_is_begun_again(self, tmp_path: Path, size: int) -> None:
        planned: PlannedDesign = loaded(tmp_path)
        Archive(tmp_path, planned).add(Evaluation({"x": 1.0}, {"a": 2.0}))
        (tmp_path / FILE).write_bytes((tmp_path / FILE).read_bytes()[:size])
        Archive(tmp_path, planned).add(Evaluation({"x": 2.0}, {"a": 3.0}))
        assert Archive(tmp_path, planned).get({"x": 2.0}).figures == {"a": 3.0}

    @pytest.mark.parametrize(
        "text", [b"x", b"x\n", b"{}\n", b'{"digest": 1}\n[]\n', b"[1]\n", b"\xff\xfe\n"]
    )
    def test_other_files_are_refused(self, tmp_path: Path, text: bytes) -> None:
        planned: PlannedDesign = loaded(tmp_path)
        (tmp_path / FILE).write_bytes(text)
        with pytest.raises(InputError, match="not the evaluations of a design"):
            Archive(tmp_path, planned)

    def test_it_is_lines_of_json(self, tmp_path: Path) -> None:
        Archive(tmp_path, loaded(tmp_path)).add(Evaluation({"x": 1.0}, {"a": 2.0}))
        lines = (tmp_path / FILE).read_text().splitlines()
        assert json.loads(lines[0])["design"] == "test"
        assert json.loads(lines[1])["figures"] == {"a": 2.0}


def sample_of(error_m: Any, world: str = "w", weather: str = "fog", counts: Any = None) -> Sample:
    errors = np.atleast_2d(np.array(error_m, dtype=float))
    kept = np.ones(errors.shape[1], bool) if counts is None else np.array(counts)
    return Sample(world, weather, kept, errors, np.full(errors.shape[1], 0.01), np.zeros(0))


class TestObjectives:
    def test_no_range_counts_as_the_limit(self) -> None:
        of = OBJECTIVES["range_error_m"].of
        assert of([sample_of([0.01, np.nan])]) == pytest.approx(np.sqrt(0.01 * LIMIT_M))
        assert of([sample_of([0.01, -5.0])]) == pytest.approx(np.sqrt(0.01 * LIMIT_M))
        rms = OBJECTIVES["range_rmse_m"].of([sample_of([0.01, np.nan])])
        assert rms == pytest.approx(np.sqrt((0.01**2 + LIMIT_M**2) / 2))

    def test_far_spots_do_not_count(self) -> None:
        spots = sample_of([0.01, np.nan], counts=[True, False])
        assert OBJECTIVES["range_error_m"].of([spots]) == pytest.approx(0.01)
        assert OBJECTIVES["range_bound_m"].of([spots]) == pytest.approx(0.01)

    def test_missing_ranges_are_a_fraction_with_half_a_spot_more(self) -> None:
        of = OBJECTIVES["range_missing"].of
        assert of([sample_of([0.01, 0.02, 0.03])]) == pytest.approx(0.5 / 4)
        assert of([sample_of([0.01, LIMIT_M, np.nan])]) == pytest.approx(2.5 / 4)

    def test_weathers_count_equally(self) -> None:
        samples = [sample_of([0.01] * 9), sample_of([0.04], weather="clear")]
        each = over_weathers("range_error_m", samples)
        assert each == pytest.approx({"fog": 0.01, "clear": 0.04})
        assert figure(each) == pytest.approx(0.02)

    def test_without_a_spot_there_is_no_figure(self) -> None:
        assert np.isnan(OBJECTIVES["range_error_m"].of([sample_of([0.1], counts=[False])]))


class TestJudgement:
    def drawn(self, factor: float, missing: int = 0) -> list[Sample]:
        rng = np.random.default_rng(0)
        worlds = [rng.normal(0, 0.01, (2, 4)) for _ in range(12)]
        samples = [sample_of(factor * each, f"w{n}") for n, each in enumerate(worlds)]
        for each in samples[:missing]:
            each.error_m[0, 0] = np.nan
        return samples

    def test_a_gain_is_measured_with_its_interval(self) -> None:
        rows = judge(self.drawn(1.0), self.drawn(0.8), ["range_error_m", "range_rmse_m"])
        for row in rows:
            if not row.is_fraction and "bound" not in row.name:
                assert row.change == pytest.approx(0.8)
                low, high = row.interval()
                assert low <= 0.8 + 1e-9
                assert high >= 0.8 - 1e-9
                assert row.better

    def test_lost_spots_count_against_it(self) -> None:
        rows = judge(self.drawn(1.0), self.drawn(1.0, missing=12), ["range_error_m"])
        lost = next(row for row in rows if row.name == WITH_A_RANGE)
        assert lost.change == pytest.approx(-100 / 8)
        assert lost.better is False
        assert next(row for row in rows if row.name == WRONG).better is None

    def test_equal_instruments_are_neither(self) -> None:
        rows = judge(self.drawn(1.0), self.drawn(1.0), ["range_error_m"])
        assert all(row.better is None for row in rows)

    def test_independent_noise_is_rarely_a_gain(self) -> None:
        def rms(pairs: Pairs) -> tuple[float, float]:
            one, other = (
                np.sqrt(np.mean([pair[n].error_m ** 2 for pair in pairs])) for n in (0, 1)
            )
            return float(one), float(other)

        wins = 0
        for seed in range(30):
            rng = np.random.default_rng(seed)
            drawn = rng.normal(0, 0.01, (10, 2, 2, 4))
            pairs = [
                (sample_of(one, f"w{n}"), sample_of(other, f"w{n}"))
                for n, (one, other) in enumerate(drawn)
            ]
            wins += compared("fog", "rms", "m", rms, pairs).better is not None
        assert wins <= 6  # 1.5 expected of 30; P(> 6) = 0.1 %
