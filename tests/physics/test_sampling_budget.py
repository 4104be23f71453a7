"""An error to order, and nothing compiled twice."""

from dataclasses import replace

import numpy as np
import pytest

import spisim
import worlds
from reconstruction.base.errors import InputError
from spisim.atmosphere import HenyeyGreenstein, explicit
from spisim.simulation.light import solve
from spisim.transport.backend import activate
from spisim.transport.engine import sampling
from spisim.transport.engine.estimator import transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.sampling import (
    MIN_LAUNCHES,
    ErrorMetric,
    PathBudget,
    TargetError,
    repeat,
)
from spisim.transport.engine.tally import PathLengthBins, Sums
from spisim.transport.world import build_world

# isort: split
import drjit as dr

END = worlds.detector([0.05, 0.0, 0.0], area_m2=2e-6, half_angle_deg=14)
VIEW = worlds.projector()


#: ‖standard errors‖ / ‖means‖ of the image.
RELATIVE = ErrorMetric(
    lambda sums: sums["image"],
    lambda mean, error: float(np.linalg.norm(error) / np.linalg.norm(mean)),
)


def room(extinction=0.1, albedo=0.98):
    position = worlds.scene(*worlds.room())
    return replace(position, atmosphere=explicit(extinction, albedo, HenyeyGreenstein(0.7)))


def test_the_error_is_what_was_asked_for():
    target = 0.03
    world = build_world(room())

    def estimate(seed):
        budget = TargetError(target, RELATIVE)
        return transport_image(world, VIEW, END, budget, seed=seed)

    estimates = [estimate(seed) for seed in worlds.seeds(12)]
    images = np.array([e.mean["image"] for e in estimates])
    spread = np.linalg.norm(images.std(axis=0, ddof=1)) / np.linalg.norm(images.mean(axis=0))
    assert 0.7 * target < spread < 1.4 * target
    claimed = [
        np.linalg.norm(e.error["image"]) / np.linalg.norm(e.mean["image"]) for e in estimates
    ]
    assert max(claimed) < target


def test_a_third_of_the_error_takes_nine_times_the_paths():
    world = build_world(room())
    paths = [
        transport_image(world, VIEW, END, TargetError(t, RELATIVE), seed=worlds.seeds(1)[0]).paths
        for t in (0.03, 0.01)
    ]
    assert 5 < paths[1] / paths[0] < 16


def test_launches_of_different_sizes_count_by_their_paths():
    """Mean and standard error of numbers whose variance is one over their paths."""
    errors, claimed = [], []
    for number in range(400):
        rng = np.random.default_rng(number)

        def launch(samples, seeds, replicas, rng=rng):
            return Sums([{"image": rng.normal(1, 1 / np.sqrt(samples), 8)}])

        budget = TargetError(0.05, RELATIVE)
        result = repeat(launch, budget, 8, np.random.SeedSequence(number), None)
        assert result.launches > MIN_LAUNCHES  # larger launches follow the first ones
        assert result.size <= 0.05
        errors.append(result.mean["image"] - 1)
        claimed.append(result.error["image"] ** 2)
        assert result.paths == pytest.approx(2 * 8 / np.mean(claimed[-1]), rel=0.8)
    ratio = np.mean(np.square(errors)) / np.mean(claimed)
    # It stops where the claimed error is small by chance: a bias of a few percent.
    assert ratio == pytest.approx(1, abs=0.1)


def test_the_standard_error_of_every_pixel_is_honest():
    world = build_world(room(0.02))
    estimates = [
        transport_image(world, VIEW, END, PathBudget(32), seed=seed) for seed in worlds.seeds(24)
    ]
    spread = np.array([e.mean["image"] for e in estimates]).std(axis=0, ddof=1)
    claimed = np.sqrt(np.mean([e.error["image"] ** 2 for e in estimates], axis=0))
    assert np.median(spread / claimed) == pytest.approx(1, abs=0.08)


def test_paths_are_split_into_launches_without_changing_the_mean(monkeypatch):
    """As many launches as the lanes of one require."""
    world = build_world(room(0.0))
    few = transport_image(world, VIEW, END, PathBudget(256), seed=worlds.seeds(1)[0])
    monkeypatch.setattr(sampling, "MAX_LANES", 10 * VIEW.pixels)
    many = transport_image(world, VIEW, END, PathBudget(256), seed=worlds.seeds(2)[1])
    assert (few.launches, many.launches) == (MIN_LAUNCHES, 256)  # of one path in each of eight
    assert few.paths == many.paths == VIEW.pixels * 256  # from one end
    np.testing.assert_allclose(few.mean["image"].sum(), many.mean["image"].sum(), rtol=0.01)


@pytest.mark.parametrize("replicas", [1, 2])
def test_no_launch_has_more_lanes_than_fit(monkeypatch, replicas):
    monkeypatch.setattr(sampling, "MAX_LANES", 100)
    launched = []

    def launch(samples, seeds, replicas):
        launched.append(samples)
        rng = np.random.default_rng(seeds[0])
        return Sums([{"image": rng.normal(1, 0.5, 30)} for _ in range(replicas)])

    budgets = [PathBudget(1), PathBudget(24), PathBudget(100), TargetError(0.05, RELATIVE)]
    for budget in budgets:
        launched.clear()
        seed = np.random.SeedSequence(0)
        result = repeat(launch, budget, 30, seed, None, replicas=replicas)
        assert result.launches == replicas * len(launched) >= MIN_LAUNCHES
        assert max(launched) * replicas * 30 <= 100
        assert result.paths == 2 * 30 * replicas * sum(launched)


def test_estimates_side_by_side_are_independent_and_make_one_launch():
    """What each finds is another estimate, and their mean that of as many launches."""
    world = build_world(room())
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        counts = []
        for launches in (1, MIN_LAUNCHES):
            dr.kernel_history_clear()
            budget = PathBudget(2 * launches, launches)
            result = transport_image(world, VIEW, END, budget, seed=worlds.seeds(1)[0])
            counts.append(len(dr.kernel_history([dr.KernelType.JIT])))
    assert result.launches == MIN_LAUNCHES
    assert counts[0] == counts[1]
    assert np.median(result.error["image"] / result.mean["image"]) > 0.01  # no copies of each other


def test_progress_rises_to_one():
    seen = []
    solve(
        worlds.scene(*worlds.room()), spisim.load_instrument("paper"), spp=8, progress=seen.append
    )
    assert np.all(np.diff(seen) >= 0)
    assert seen[-1] == 1


@pytest.mark.parametrize(
    "outputs",
    [Outputs(), Outputs(orders=True, frequencies_hz=(15e6,), bins=PathLengthBins(100, 0.1))],
    ids=["image", "everything"],
)
def test_poses_densities_seeds_and_paths_compile_nothing_new(outputs):
    activate()

    def trace(extinction, albedo, position, seed, paths):
        world = build_world(room(extinction, albedo))
        view = worlds.projector(pose=worlds.pose_at(position))
        entropy = np.random.SeedSequence(seed)
        transport_image(world, view, END, PathBudget(paths), seed=entropy, outputs=outputs)
        beams = worlds.beams([0.05, 0.02 * seed, 1.0])
        worlds.histogram(world, beams, END, (500, 0.1), 8 * paths, np.random.SeedSequence(seed))

    trace(0.1, 0.98, (0, 0, 0), 1, 64)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        trace(0.2, 0.9, (0.1, 0, 0.2), 2, 48)
        history = dr.kernel_history([dr.KernelType.JIT])
    assert len(history) > 0
    assert [kernel for kernel in history if not kernel["cache_hit"]] == []


def test_a_modulation_too_fast_for_the_histogram_is_refused():
    paper = spisim.load_instrument("paper")
    modulation = paper.tof.modulation.model_copy(update={"frequencies_hz": (15e6, 9.9e9)})
    fast = paper.model_copy(update={"tof": paper.tof.model_copy(update={"modulation": modulation})})
    with pytest.raises(InputError, match=r"tof\.modulation\.frequencies_hz 9\.9e\+09.*at most"):
        solve(worlds.scene(*worlds.room()), fast, spp=8)


@pytest.mark.parametrize("frequency_hz", [-1.0, 1e13, np.inf, np.nan])
def test_a_phasor_beyond_the_precision_of_path_lengths_is_refused(frequency_hz):
    with pytest.raises(InputError, match=r"frequencies_hz .*0 to 1e\+10"):
        Outputs(frequencies_hz=(15e6, frequency_hz))
