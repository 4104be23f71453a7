"""The depth map: better than the nearest anchor on average, sane on bad input; point clouds."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from images import image_from
from reconstruction.capture import Optics
from reconstruction.depth import kriging, pixel_of, pixel_rays, point_cloud_ply
from reconstruction.depth.kriging import FITTED, fitted_prior
from reconstruction.depth.methods.inverse_distance import METHOD as INVERSE_DISTANCE
from reconstruction.depth.methods.nearest import METHOD as NEAREST
from reconstruction.depth.pixels import around, between
from reconstruction.operators import fwht, make_plan

SIDE = 64
OPTICS = Optics(tan_half_width=0.36, tan_half_height=0.36)
RAYS = pixel_rays(OPTICS, (SIDE, SIDE))
UNIT_RAYS = RAYS / np.linalg.norm(RAYS, axis=-1, keepdims=True)
PRIOR = fitted_prior()
ANCHORS = np.array([[15.5, 15.5], [15.5, 47.5], [47.5, 15.5], [47.5, 47.5]])


def anchored_depth(image, anchors, depth_m, sigma_m):
    result = kriging.anchored_depth(image, anchors, depth_m, sigma_m, PRIOR)
    return None if result is None else result.depth_m


class View:
    """Ray casting of planes and boxes seen from the origin, each with a random reflectance."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.range_m = np.full((SIDE, SIDE), np.inf)
        self.image = np.zeros((SIDE, SIDE))

    def surface(self, range_m, cosine):
        nearer = (range_m > 0) & (range_m < self.range_m)
        reflected = self.rng.uniform(0.15, 0.85) * np.abs(cosine)
        self.range_m[nearer] = range_m[nearer]
        self.image[nearer] = (reflected / range_m**2)[nearer]

    def plane(self, normal, distance):
        cosine = UNIT_RAYS @ np.array(normal, dtype=float)
        self.surface(np.where(cosine > 1e-9, distance / np.maximum(cosine, 1e-9), np.inf), cosine)

    def box(self, centre, half):
        near = np.sort([(centre - half) / UNIT_RAYS, (centre + half) / UNIT_RAYS], axis=0)
        entry, leave = near[0].max(axis=-1), near[1].min(axis=-1)
        face = near[0].argmax(axis=-1)[..., None]
        cosine = np.take_along_axis(UNIT_RAYS, face, axis=-1)[..., 0]
        self.surface(np.where(entry < leave, entry, np.inf), cosine)

    @property
    def depth_m(self):
        return self.range_m * UNIT_RAYS[..., 2]


def make_view(kind, seed):
    view = View(seed)
    distance = view.rng.uniform(4, 9)
    view.plane((0, 0, 1), distance)
    if kind == "corridor":
        width, height = view.rng.uniform(0.8, 1.5, 2)
        for normal in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)):
            view.plane(normal, width if normal[0] else height)
    else:
        view.plane((0, 1, 0), view.rng.uniform(0.7, 1.5))
    if kind == "boxes":
        for _ in range(view.rng.integers(2, 6)):
            centre = view.rng.uniform([-1, -1, 0.35 * distance], [1, 1, 0.9 * distance])
            view.box(centre, view.rng.uniform(0.15, 0.7, 3))
    return view


def at_anchors(depth_m):
    rows, columns = ANCHORS.round().astype(int).T
    return depth_m[rows, columns]


@pytest.mark.parametrize("kind", ["floor", "corridor", "boxes"])
@pytest.mark.parametrize("sampled", [False, True])
def test_anchored_map_beats_the_nearest_anchor_on_average(kind, sampled):
    errors, close = [], []
    for seed in range(20):
        view = make_view(kind, seed)
        image = view.image
        if sampled:  # 128 of 4096 patterns, 5 % noise
            index = make_plan((SIDE, SIDE), 128, polarity="signed").index
            coefficients = fwht(image.ravel())
            sigma = 0.05 * coefficients[1:].std()
            coefficients = coefficients[index] + view.rng.normal(0, sigma, index.size)
            image = image_from(coefficients, index, (SIDE, SIDE), noise=sigma)
        ranges = at_anchors(view.depth_m)
        maps = (
            anchored_depth(image, ANCHORS, ranges, np.full(4, 0.01)),
            NEAREST.ranges((SIDE, SIDE), ANCHORS, ranges),
        )
        errors.append([np.abs(m - view.depth_m).mean() for m in maps])
        close.append([np.mean(np.abs(m / view.depth_m - 1) < 0.25) for m in maps])
    anchored, nearest = np.mean(errors, axis=0)
    assert anchored < nearest
    anchored, nearest = np.mean(close, axis=0)
    assert anchored > nearest


def test_a_uniform_wall_is_flat():
    view = View(0)
    view.plane((0, 0, 1), 5.0)
    mapped = anchored_depth(view.image, ANCHORS, at_anchors(view.depth_m), np.full(4, 0.01))
    assert np.abs(mapped / view.depth_m - 1).max() < 0.03


def test_where_all_anchors_agree_contrast_is_that_of_the_surface():
    rows, columns = np.mgrid[:SIDE, :SIDE]
    checks = np.where((rows // 8 + columns // 8) % 2, 0.8, 0.3)
    alike = anchored_depth(checks, ANCHORS, np.full(4, 5.0), np.full(4, 0.01))
    depths = np.array([3.0, 5.0, 5.0, 8.0])
    differing = anchored_depth(checks, ANCHORS, depths, np.full(4, 0.01))
    spread = [np.log(m[:8].max() / m[:8].min()) for m in (alike, differing)]
    assert spread[0] < 0.5 * spread[1]


def test_bright_things_may_be_nearer_than_all_anchors_but_dark_ones_no_farther():
    image = np.full((SIDE, SIDE), 1.0)
    image[28:36, 28:36] = 4.0
    image[:6] = 0.1
    mapped = anchored_depth(image, ANCHORS, np.array([4.0, 4.0, 6.0, 6.0]), np.full(4, 0.01))
    assert mapped[32, 32] < 4.0
    assert mapped[:6].max() <= 6.0


def test_the_map_does_not_depend_on_the_unit_of_the_image():
    rows, columns = np.mgrid[:SIDE, :SIDE]
    image, depths = 1e-3 + rows * columns / SIDE**2, np.array([3.0, 5.0, 5.0, 8.0])
    one, other = (anchored_depth(k * image, ANCHORS, depths, np.full(4, 0.01)) for k in (1, 1e4))
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_the_map_passes_near_precise_anchors():
    view = make_view("corridor", 3)
    ranges = at_anchors(view.depth_m) * np.array([0.9, 1.0, 1.1, 1.2])
    mapped = anchored_depth(view.image, ANCHORS, ranges, np.full(4, 1e-3))
    assert np.allclose(at_anchors(mapped), ranges, rtol=0.05)


def test_an_uncertain_anchor_counts_less():
    image = np.ones((SIDE, SIDE))
    ranges = np.array([4.0, 4.0, 4.0, 8.0])
    sure = anchored_depth(image, ANCHORS, ranges, np.full(4, 0.01))
    doubtful = anchored_depth(image, ANCHORS, ranges, np.array([0.01, 0.01, 0.01, 6.0]))
    assert abs(doubtful[48, 48] - 4) < 0.5 * abs(sure[48, 48] - 4)


def test_invalid_spots_are_ignored():
    view = make_view("floor", 1)
    ranges = at_anchors(view.depth_m)
    ranges[2] = np.nan
    sigma = np.where(np.isfinite(ranges), 0.01, np.nan)
    keep = [0, 1, 3]
    expected = anchored_depth(view.image, ANCHORS[keep], ranges[keep], sigma[keep])
    assert np.array_equal(anchored_depth(view.image, ANCHORS, ranges, sigma), expected)
    nearest = NEAREST.ranges((SIDE, SIDE), ANCHORS, ranges)
    assert set(np.unique(nearest)) == set(ranges[keep])


def test_one_valid_spot_is_enough():
    ranges = np.array([np.nan, 3.0, np.nan, np.nan])
    mapped = anchored_depth(np.ones((SIDE, SIDE)), ANCHORS, ranges, np.full(4, 0.01))
    assert np.allclose(mapped, 3)


def test_nothing_to_go_by_gives_no_map():
    none = np.full(4, np.nan)
    assert anchored_depth(np.ones((8, 8)), ANCHORS, none, none) is None
    assert NEAREST.ranges((8, 8), ANCHORS, none) is None
    assert anchored_depth(np.zeros((8, 8)), ANCHORS, np.ones(4), np.ones(4)) is None


def test_a_noisy_image_stays_within_limits():
    image = np.random.default_rng(4).normal(0.1, 1, (SIDE, SIDE))
    ranges = np.array([2.0, 3.0, 4.0, 5.0])
    mapped = anchored_depth(image, ANCHORS, ranges, np.full(4, 0.01))
    assert mapped.min() >= 2 / PRIOR.max_nearer
    assert mapped.max() <= 5


def test_nearest_takes_the_closest_spot_in_pixels():
    nearest = NEAREST.ranges((4, 4), np.array([[0, 0], [0, 3], [3, 0], [3, 3]]), np.arange(1.0, 5))
    assert nearest.tolist() == [[1, 1, 2, 2]] * 2 + [[3, 3, 4, 4]] * 2


def test_inverse_distance_is_the_range_at_a_spot_and_their_mean_between():
    anchors = np.array([[0, 0], [0, 4], [4, 0], [4, 4]])
    result = INVERSE_DISTANCE.ranges((5, 5), anchors, np.arange(1.0, 5))
    np.testing.assert_allclose(result[[0, 0, 4, 4], [0, 4, 0, 4]], [1, 2, 3, 4], rtol=1e-6)
    assert result[2, 2] == pytest.approx(2.5)
    # 1 / 1 and 1 / 9 of two at distances 1 and 3
    pair = INVERSE_DISTANCE.ranges((1, 5), anchors[:2], np.array([1.0, 2.0]))
    assert pair[0, 1] == pytest.approx((1 + 2 / 9) / (1 + 1 / 9))
    lost = np.array([np.nan, 2.0, np.nan, np.nan])
    assert (INVERSE_DISTANCE.ranges((5, 5), anchors, lost) == 2).all()
    assert INVERSE_DISTANCE.ranges((5, 5), anchors, np.full(4, np.nan)) is None


def test_a_map_is_the_surer_the_nearer_its_anchors_and_the_less_they_differ():
    def sigma(depth_m):
        result = kriging.anchored_depth(
            np.ones((SIDE, SIDE)), ANCHORS, np.array(depth_m), np.full(4, 0.01), PRIOR
        )
        return result.sigma

    flat, steep = sigma([4.0, 4.0, 4.0, 4.0]), sigma([2.0, 4.0, 4.0, 8.0])
    assert (steep > flat).all()
    rows, columns = ANCHORS.round().astype(int).T
    assert flat[rows, columns].max() < flat[0, 0]
    assert (flat > 0).all()


def test_deviations_are_those_of_kriging():
    """Against the variance of a Gaussian process with an unknown mean, in closed form."""
    prior = replace(PRIOR, nugget=0.1, correlation_length=0.3, sigma_factor=1.0)
    sigma = np.array([0.05, 0.1, 0.2, 0.4])
    depth_m = np.array([3.0, 4.0, 5.0, 6.0])
    image = np.ones((SIDE, SIDE))
    result = kriging.anchored_depth(image, ANCHORS, depth_m, sigma * depth_m, prior)
    weight = 1 / (1 + (sigma / prior.log_depth_sigma) ** 2)
    logs = np.log(depth_m)
    scatter = weight @ (logs - weight @ logs / weight.sum()) ** 2
    variance = (prior.log_depth_sigma**2 + scatter) / max(weight.sum(), 1.0)
    fraction = 4 * variance / (4 * variance + prior.log_reflectance_sigma**2)
    variance *= 1 - fraction
    pixel = np.array([[20.0, 30.0]])
    positions = np.concatenate([ANCHORS, pixel])
    apart = ((positions[:, None] - positions) ** 2).sum(axis=-1)
    covariance = variance * np.exp(-apart / (2 * (0.3 * SIDE) ** 2))
    inverse = np.linalg.inv(covariance[:4, :4] + np.diag(sigma**2 + 0.1 * variance))
    cross, ones = covariance[:4, 4], np.ones(4)
    simple = 1.1 * variance - cross @ inverse @ cross
    of_mean = (1 - ones @ inverse @ cross) ** 2 / (ones @ inverse @ ones)
    assert result.sigma[20, 30] == pytest.approx(np.sqrt(simple + of_mean))


def test_the_prior_rests_on_other_families_than_those_that_judge_it():
    fields = json.loads(FITTED.read_text())
    learn, judge = (set(fields[part]["families"]) for part in ("learn", "judge"))
    assert learn
    assert judge
    assert not learn & judge
    assert fields["taken"] == (fields["judge"]["error_fitted"] < fields["judge"]["error_before"])
    assert 0.92 <= fields["judge"]["within_2_sigma"] <= 0.99


def test_rays_and_pixels_are_each_others_inverse():
    optics = Optics(tan_half_width=0.4, tan_half_height=0.2)
    rays = pixel_rays(optics, (8, 16))
    assert rays[0, 0] == pytest.approx([-0.4 * 15 / 16, -0.2 * 7 / 8, 1])  # top left: -x, -y
    rows, columns = np.mgrid[:8, :16]
    pixels = pixel_of(rays.reshape(-1, 3) * 2.5, optics, (8, 16))
    assert np.allclose(pixels, np.stack([rows.ravel(), columns.ravel()], axis=1))


def test_point_cloud_is_read_by_other_software(tmp_path):
    points = np.random.default_rng(5).random((4, 6, 3))
    points[0, 0] = np.nan
    image = np.linspace(-1, 10, 24).reshape(4, 6)
    (tmp_path / "cloud.ply").write_bytes(point_cloud_ply(points, image))
    cloud = trimesh.load(tmp_path / "cloud.ply")
    assert np.allclose(cloud.vertices, points.reshape(-1, 3)[1:], atol=1e-6)
    assert cloud.colors[-1, :3].tolist() == [255] * 3
    assert cloud.colors[0, :3].tolist() == [0] * 3


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (7, 4)])
def test_means_and_values_between_pixels_are_those_of_scipy(shape):
    rng = np.random.default_rng(3)
    image, positions = rng.random(shape), (np.array(shape) + 2) * rng.random((20, 2)) - 1.5
    np.testing.assert_allclose(around(image), ndimage.uniform_filter(image, 3))
    expected = ndimage.map_coordinates(image, positions.T, order=1, mode="nearest")
    np.testing.assert_allclose(between(image, positions), expected)
