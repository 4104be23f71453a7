"""The aperture in front of beams that takes in most, against a scan of apertures."""

from typing import Any

import numpy as np
import pytest

from instruments import changed
from reconstruction.base.errors import InputError
from spisim.budget import class_1_power_w, laser_safety
from spisim.budget.apertures import Worst, flood_fraction, worst_apertures
from spisim.instrument import load_instrument
from spisim.instrument.steering import directions

RADIUS_RAD = np.radians(1.0)
FRAMES = 60
HAZARD = np.arange(1.0, FRAMES + 1) ** -0.25
"""Of a beam in a frame, within a time: n frames on end have n^0.75."""


def scan(rng: np.random.Generator) -> Any:
    """Angles (FRAMES, beams, 2) of a raster, a Lissajous figure or random points."""
    beams, half_deg = int(rng.integers(1, 4)), rng.uniform(1, 4, 2)
    frames = np.arange(FRAMES)
    kind = rng.integers(3)
    if kind == 0:
        columns = int(rng.integers(2, 9))
        row, column = np.divmod(frames % (columns * int(rng.integers(1, 7))), columns)
        unit = 2 * np.stack([column, row], -1) / columns - 1
    elif kind == 1:
        unit = np.sin(2 * np.pi * frames[:, None] * rng.uniform(0.01, 0.4, 2))
    else:
        unit = rng.uniform(-1, 1, (FRAMES, 2))
    home_deg = rng.uniform(-3, 3, (beams, 2)) + rng.uniform(-30, 30, 2)
    return home_deg + (unit * half_deg)[:, None]


def taken_in(angles_deg: Any, centres: Any, radius_rad: float) -> Worst:
    """What the worst of apertures around some directions (n, 3) takes in."""
    inside = centres @ directions(angles_deg).reshape(-1, 3).T >= np.cos(radius_rad)
    beams = inside.reshape(len(centres), *angles_deg.shape[:2]).sum(axis=2)
    before = np.pad(np.cumsum(beams, axis=1), ((0, 0), (1, 0)))
    within = [(before[:, n:] - before[:, :-n]).max() for n in range(1, FRAMES + 1)]
    return Worst(beams.max(), beams.mean(axis=1).max(), (within * HAZARD).max())


def grid(angles_deg: Any, radius_rad: float) -> Any:
    """Directions an eighth of a radius apart in and around a scan."""
    low, high = (each(angles_deg, axis=(0, 1)) for each in (np.min, np.max))
    step = np.degrees(radius_rad) / 8
    across, up = (
        np.arange(a - 8 * step, b + 8 * step, step) for a, b in zip(low, high, strict=True)
    )
    return directions(np.stack(np.meshgrid(across, up), -1).reshape(-1, 2))


def through_pairs(angles_deg: Any, radius_rad: float) -> Any:
    """Centres of all apertures whose rim runs through two points, and the points."""
    points = np.unique(directions(angles_deg).reshape(-1, 3), axis=0)
    one, other = (points[each] for each in np.triu_indices(len(points), 1))
    cosine = (one * other).sum(axis=1)
    along = np.cos(radius_rad) / (1 + cosine)
    square = (1 - 2 * along**2 * (1 + cosine)) / (1 - cosine**2)
    near = square >= 0
    middle = (along[:, None] * (one + other))[near]
    aside = (np.sqrt(np.maximum(square, 0))[:, None] * np.cross(one, other))[near]
    return np.concatenate([points, middle + aside, middle - aside])


@pytest.mark.parametrize("seed", range(4))
def test_no_aperture_of_200_scans_takes_in_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(50):
        angles_deg = scan(rng)
        worst = worst_apertures(angles_deg, RADIUS_RAD, HAZARD)
        scanned = taken_in(angles_deg, grid(angles_deg, RADIUS_RAD), RADIUS_RAD)
        assert np.all(np.array(worst) >= scanned)
        larger = RADIUS_RAD * (1 + 1e-6)  # apertures with points on the rim count as well
        exact = taken_in(angles_deg, through_pairs(angles_deg, larger), larger * (1 + 1e-9))
        assert np.all(np.array(worst) <= np.array(exact) * [1, 1, 1.02])


@pytest.mark.parametrize(
    ("apart_deg", "steps_deg"), [(3.11, [0.74, 0.63]), (4.69, [0.79, 0.3]), (4.65, [0.88, 0.31])]
)
@pytest.mark.parametrize("elevation_deg", [0, 40])
def test_columns_of_rasters_side_by_side(
    apart_deg: float, steps_deg: list[float], elevation_deg: float
) -> None:
    """Two beams over 7 x 8 points, near each other: exact, as if through all pairs."""
    row, column = np.divmod(np.arange(56), 8)
    raster = np.stack([column, row - 3], -1) * steps_deg + [0, elevation_deg]
    angles_deg = raster[:, None] + np.array([[0, 0], [apart_deg, 0]])
    larger = RADIUS_RAD * (1 + 1e-6)
    centres = through_pairs(angles_deg, larger)
    inside = centres @ directions(angles_deg).reshape(-1, 3).T >= np.cos(larger * (1 + 1e-9))
    mean = worst_apertures(angles_deg, RADIUS_RAD, np.ones(56)).mean
    assert mean == inside.sum(axis=1).max() / 56


def test_rows_of_a_slow_raster_that_follow_each_other_add_up() -> None:
    """Passes of 3 of 32 points through four rows within 0.35 s: 8 mJ."""
    angles_deg = np.zeros((128, 1, 2))
    row, column = np.divmod(np.arange(128), 32)
    angles_deg[:, 0] = np.stack([2.0 * column, 0.1 * row], -1)
    hazard = np.full(128, 0.01)
    one_row = worst_apertures(angles_deg[:32], np.radians(2.1), hazard[:32]).hazard
    assert one_row == pytest.approx(0.03)
    assert worst_apertures(angles_deg, np.radians(2.1), hazard).hazard == pytest.approx(4 * one_row)


def safeguarded(**steering: Any) -> Any:
    fields = {"half_range_deg": [4.5, 4.5], "scan_safeguard": True} | steering
    return changed("paper-steered", lasers__steering=fields)


def test_four_points_of_a_raster_fit_between_them() -> None:
    """1.96 mm apart: 4 of 64 points within 3.5 mm, of 10 mW."""
    assert class_1_power_w(safeguarded(mode="raster", shape=[8, 8])) == pytest.approx(0.16)


def test_points_are_as_near_as_the_sphere_has_them() -> None:
    """Azimuths 2.4° apart at an elevation of 60° are 1.2° apart, wherever the axis points."""
    angles_deg = np.array([[[0.0, 60.0], [2.4, 60.0], [0.0, 0.0], [2.4, 0.0]]])
    assert worst_apertures(angles_deg, np.radians(0.61), np.zeros(1)).beams == 2
    assert worst_apertures(angles_deg, np.radians(0.59), np.zeros(1)).beams == 1
    wide = changed("paper", lasers__directions_deg=[[50, 0], [51.9, 0], [-50, 0], [0, 50]])
    assert laser_safety(wide).beams == 2  # 3.3 mm apart 10 cm from where they leave


@pytest.mark.parametrize(
    "steering",
    [
        {"mode": "raster", "shape": [1, 1]},
        {"mode": "lissajous", "cycles_per_frame": [1, 0.5]},
        {"mode": "lissajous", "cycles_per_frame": [1e-5, 1e-5]},
    ],
)
def test_a_scan_that_hardly_moves_counts_as_standing(steering: dict[str, Any]) -> None:
    standing = class_1_power_w(load_instrument("paper-steered"))
    assert class_1_power_w(safeguarded(**steering)) == pytest.approx(standing)


def test_turns_after_the_first_frames_count() -> None:
    """A sine of 4000 frames stays within 1° of its turn for acos(1 - 2/40) / π of them."""
    slow = safeguarded(
        mode="lissajous", cycles_per_frame=[1 / 4000, 0.25], half_range_deg=[40, 1e-6]
    )
    lasers = {"directions_deg": [[0, 0]], "power_w": 5e-3, "steering": slow.lasers.steering}
    slow = slow.model_copy(update={"lasers": slow.lasers.model_copy(update=lasers)})
    assert laser_safety(slow).mean_margin == pytest.approx(
        0.5 * np.arccos(1 - 2 * np.degrees(np.arctan(1.75e-2)) / 40) / np.pi, rel=0.01
    )


def test_sines_near_a_fraction_shift_to_where_they_stay_longest() -> None:
    """Two of three frames at one end, after 5000 that began with one of three in the middle."""
    cycles = 1 / 3 + 1 / 60000
    near = safeguarded(mode="lissajous", cycles_per_frame=[cycles, cycles])
    lasers = near.ranging.lasers
    assert lasers.steering is not None
    later = [lasers.steering.offsets(frame, 1) for frame in range(5000, 5100)]
    two_of_three = worst_apertures(np.array(later), np.arctan(1.75e-2), np.zeros(100)).mean
    assert two_of_three > 0.65
    mean_w = two_of_three * lasers.power_w
    assert laser_safety(near).mean_margin >= mean_w / 10e-3


def test_apertures_without_area_hold_what_falls_on_one_point() -> None:
    angles_deg = np.array([[[0.0, 0], [0, 0]], [[1, 0], [0, 0]], [[2, 0], [2, 0]]])
    # two beams at once within one frame, and three within two frames
    assert worst_apertures(angles_deg, 0.0, np.array([1.0, 0.9, 0.5])) == (2, 1.0, 2.7)
    with pytest.raises(InputError, match="radius_rad should be at least 0"):
        worst_apertures(angles_deg, -1.0, np.ones(3))
    with pytest.raises(InputError, match="radius_rad should be at least 0"):
        worst_apertures(angles_deg, np.nan, np.ones(3))


@pytest.mark.parametrize("falloff", [-4.0, -3.0, 0.0, 2.0, 100.0])
@pytest.mark.parametrize("flood_deg", [3.0, 10.0, 65.0, 140.0])
def test_the_part_of_a_flood_in_the_worst_aperture(falloff: float, flood_deg: float) -> None:
    """Against sums over a fine grid of directions, for apertures all over the flood."""
    zones = load_instrument("vl53l5cx").zones.model_copy(
        update={"flood_deg": flood_deg, "flood_falloff": falloff}
    )
    radius, edge = 0.035, np.radians(flood_deg) / 2
    step = radius / 150
    taken = []
    for place in np.linspace(0, edge, 41):
        near = np.arange(max(place - radius, 0), min(place + radius, edge), step) + step / 2
        around = np.linspace(-np.pi, np.pi, 4001)
        angle = near[:, None]
        apart = np.cos(place) * np.cos(angle) + np.sin(place) * np.sin(angle) * np.cos(around)
        light = np.cos(angle) ** falloff * np.sin(angle) * (angle < edge)
        taken.append((light * (apart > np.cos(radius))).sum() * step * 2 * np.pi / 4000)
    fraction = flood_fraction(zones, radius)
    assert fraction <= 1
    assert fraction == pytest.approx(zones.axial_intensity * max(taken), rel=0.02)
