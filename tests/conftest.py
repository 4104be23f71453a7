"""Fixtures that several test modules share."""

import os
from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np
import pytest
import typer.testing
from scipy.constants import c
from threadpoolctl import threadpool_limits

from reconstruction import Capture, PatternPlan, make_plan
from reconstruction.capture import Buckets, FrameTruth, Optics, Provenance, Truth
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.operators import expose
from spisim.dataset.records import Outcome
from spisim.dataset.workers import LocalExecutor
from spisim.transport.backend import use_threads

pytest_plugins = ["parts", "references"]

# The tree of commands is built once, as by a program, and not anew for each command.
typer.testing._get_command = cache(typer.testing._get_command)  # type: ignore[attr-defined]

SHAPE = (16, 16)
PERIOD_S = 1 / 15_000


@pytest.fixture(scope="session", autouse=True)
def _one_thread_per_worker() -> None:
    """Of `pytest -n`: further threads wait busily, on the cores of other workers."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        use_threads(1)
        threadpool_limits(1)
        os.environ["OMP_NUM_THREADS"] = "1"  # for processes that tests start


@pytest.fixture
def no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples are made and evaluated in this process; workers take seconds to start."""

    def run(executor: LocalExecutor, indices: Iterable[int]) -> Iterator[Outcome]:
        return map(executor._make, list(indices))

    monkeypatch.setattr(LocalExecutor, "run", run)


@pytest.fixture(scope="session")
def plan() -> PatternPlan:
    """Half of the patterns of 16 × 16 pixels."""
    return make_plan(SHAPE, 128)


@pytest.fixture(scope="session")
def capture(plan: PatternPlan) -> Capture:
    """A noise-free capture of a slanted wall with a bright square, no light transport involved."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    image = 1000.0 + 2000.0 * ((rows > 4) & (rows < 11) & (columns > 4) & (columns < 11))
    depth = 4.0 + columns / 16
    directions = np.array([[x, y, 1.0] for y in (-0.05, 0.05) for x in (-0.05, 0.05)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    spot_range = np.array([4.2, 4.7, 4.3, 4.8])
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=expose(plan, image)[None],
            saturated=np.zeros((1, plan.exposures), bool),
            exposure_time_s=PERIOD_S,
            pattern_period_s=PERIOD_S,
            electrons_per_count=1.0,
            offset_counts=0.0,
            noise_electrons=0.0,
            excess_noise_factor=1.0,
            dead_time_s=0.0,
        ),
        spots=_spots(directions, spot_range),
        optics=Optics(tan_half_width=0.1, tan_half_height=0.1),
        provenance=Provenance(
            source="simulation",
            software="test",
            created="2026-01-01T00:00:00+00:00",
            instrument="wavelength_nm: 1550",
            scene="name: <wall>",
            seed=0,
            settings="spp: 7",
        ),
        truth=Truth.of(
            [
                FrameTruth(
                    image=image.astype(np.float32),
                    image_error=(0.01 * image).astype(np.float32),
                    range_m=depth.astype(np.float32),
                    depth_m=depth.astype(np.float32),
                    reflectance=np.full(SHAPE, 0.5, np.float32),
                    spot_range_m=spot_range,
                )
            ]
        ),
    )


def _spots(directions: np.ndarray, range_m: np.ndarray) -> CwSpots:
    """Four taps of every spot, detectors in the pinhole: S_k = B + A cos(phase - phase_k)."""
    frequency_hz = 10e6
    tap_phases = np.arange(4) * np.pi / 2
    phase = 2 * np.pi * frequency_hz * 2 * range_m / c
    taps = 2e5 + 1e5 * np.cos(phase[:, None] - tap_phases)
    return CwSpots(
        taps=taps[None],
        saturated=np.zeros((1, 4, 4), bool),
        directions=directions,
        detector_positions_m=np.zeros((4, 3)),
        clear_probability=1.0,
        tap_frequencies_hz=np.full(4, frequency_hz),
        tap_phases_rad=tap_phases,
        phase_offsets_rad=np.zeros(4),
        periods=100,
        electrons_per_count=1.0,
        offset_counts=0.0,
        noise_electrons=np.full(4, 10.0),
        excess_noise_factor=1.0,
    )
