"""The same light from every backend, and the same bits however one backend runs."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from mitsuba_reference import MITSUBA_FROM_OPTICAL, pattern_emitter

import worlds
from spisim.transport.backend import CUDA_VARIANT, LLVM_VARIANT, activate, has_cuda, use_threads
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.lights import Lamp
from spisim.transport.engine.tally import ImageTally, Tallies
from spisim.transport.engine.walk import Walk
from spisim.transport.engine.weights import alone
from spisim.transport.meshes import shapes
from spisim.transport.world import build_world

# isort: split
import drjit as dr
import mitsuba as mi

END = worlds.detector([0.05, 0.0, 0.0], area_m2=2e-6, half_angle_deg=14)
VIEW = worlds.projector(shape=(8, 8))
SEEDS = worlds.seeds(8)
CLEAR = worlds.scene(*worlds.room())
FOGGY = worlds.scene(*worlds.room(), extinction_per_m=0.1, albedo=0.98, g=0.7)


@contextmanager
def variant(name: str) -> Iterator[None]:
    before = activate()
    mi.set_variant(name)
    try:
        yield
    finally:
        mi.set_variant(before)


def images(spp: int) -> np.ndarray:
    world = build_world(FOGGY)
    return np.array([worlds.image(world, VIEW, END, spp, seed) for seed in SEEDS])


def test_the_engine_agrees_with_mitsuba_without_a_compiler() -> None:
    """A camera's picture: our walk as compiled, and Mitsuba's path tracer in its scalar variant."""
    pose = worlds.pose_at((0.0, -0.05, 0.0))
    camera_view, samples = worlds.projector(shape=(8, 8), pose=pose), 1024
    world = build_world(CLEAR)
    lamp = Lamp.of(VIEW, np.ones(VIEW.shape))
    camera = Projector.of(camera_view, samples)
    ours = []
    for seed in range(len(SEEDS)):
        tallies = Tallies(camera.pixels, [ImageTally])
        Walk(world, camera, lamp, False, alone, tallies.add).run(seed)
        (sums,) = tallies.read(1.0).values
        ours.append(sums["image"].reshape(8, 8) * VIEW.pixels)
    with variant("scalar_rgb"):
        film = {"width": 8, "height": 8, "pixel_format": "luminance", "rfilter": {"type": "box"}}
        scene = mi.load_dict(
            {
                "type": "scene",
                **shapes(CLEAR.objects),
                "projector": pattern_emitter(VIEW),
                "integrator": {"type": "path", "max_depth": 256},
                "camera": {
                    "type": "perspective",
                    "fov": 20.0,
                    "fov_axis": "x",
                    "to_world": mi.ScalarTransform4f((pose @ MITSUBA_FROM_OPTICAL).tolist()),
                    "film": {"type": "hdrfilm", **film},
                    "sampler": {"type": "independent"},
                },
            }
        )
        theirs = [
            np.array(mi.render(scene, spp=samples, seed=seed))[..., 0] for seed in range(len(SEEDS))
        ]
    assert np.all(np.abs(worlds.z_score(ours, theirs)) < 5)
    assert np.mean(ours) == pytest.approx(np.mean(theirs), rel=0.01)


@pytest.mark.gpu
def test_cuda_and_llvm_agree() -> None:
    if not (has_cuda() and dr.has_backend(dr.JitBackend.LLVM)):
        pytest.skip("needs both a CUDA device and LLVM")
    result = []
    for name in (CUDA_VARIANT, LLVM_VARIANT):
        with variant(name):
            result.append(images(256))
    on_gpu, on_cpu = result
    assert np.all(np.abs(worlds.z_score(on_gpu, on_cpu)) < 5)
    assert on_gpu.mean() == pytest.approx(on_cpu.mean(), rel=0.01)


def test_the_same_bits_from_one_thread_as_from_many() -> None:
    many = images(32)
    threads = dr.thread_count()
    use_threads(1)
    try:
        np.testing.assert_array_equal(images(32), many)
    finally:
        use_threads(threads)


def test_the_same_bits_from_loops_that_run_step_by_step() -> None:
    """Loops evaluated one iteration at a time, in place of one compiled kernel."""
    world = build_world(FOGGY)
    compiled = worlds.image(world, VIEW, END, 32, SEEDS[0])
    with dr.scoped_set_flag(dr.JitFlag.SymbolicLoops, False):
        stepped = worlds.image(world, VIEW, END, 32, SEEDS[0])
    np.testing.assert_array_equal(stepped, compiled)
