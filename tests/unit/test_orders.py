"""Pattern orders against their definitions, counted in the patterns themselves."""

import numpy as np
import pytest
from scipy.linalg import hadamard
from scipy.ndimage import label

from reconstruction.base.errors import InputError
from reconstruction.operators import BASES, ORDERS, make_plan, ordered_rows
from reconstruction.operators.bases.hadamard import Hadamard
from reconstruction.operators.orders.variance_ranked import ALONG, DOWN

SHAPES = ((8, 8), (4, 16), (16, 2), (1, 8))
NAMED = [name if name != "random" else "random:3" for name in ORDERS]


def patterns(shape):
    """All rows (N, H, W) as the matrix of SciPy has them."""
    return hadamard(shape[0] * shape[1]).reshape(-1, *shape)


def changes(rows, axis):
    """Sign changes of patterns (N, H, W) down (1) or along (2) the image, at its first pixels."""
    line = rows[:, :, 0] if axis == 1 else rows[:, 0, :]
    return np.count_nonzero(np.diff(line, axis=1), axis=1)


def total_variation(row):
    """Sum of all steps between neighbours of one pattern."""
    return np.abs(np.diff(row, axis=0)).sum() + np.abs(np.diff(row, axis=1)).sum()


def blocks(row):
    """Connected areas of one pattern, white and black."""
    return label(row > 0)[1] + label(row < 0)[1]


def radius(row):
    """Squared frequency at which a pattern has its sign changes."""
    pattern = row[None]
    return (changes(pattern, 1)[0] / row.shape[0]) ** 2 + (
        changes(pattern, 2)[0] / row.shape[1]
    ) ** 2


def product(row):
    """Number of sign changes down times along, of which there is one at least."""
    return max(changes(row[None], 1)[0], 1) * max(changes(row[None], 2)[0], 1)


def flat_changes(row):
    """Sign changes along the row of length N."""
    return np.count_nonzero(np.diff(row.ravel()))


@pytest.mark.parametrize("shape", [*SHAPES, (16, 16)])
@pytest.mark.parametrize("order", NAMED)
def test_every_order_holds_every_row_once_and_starts_all_on(order, shape):
    rows = ordered_rows(Hadamard(shape), order)
    assert np.array_equal(np.sort(rows), np.arange(shape[0] * shape[1]))
    assert rows[0] == 0


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    ("order", "counted"),
    [
        ("sequency", flat_changes),
        ("sequency-2d", total_variation),
        ("cake-cutting", blocks),
        ("radius", radius),
        ("product", product),
    ],
)
def test_what_an_order_goes_by_never_falls(order, counted, shape):
    rows = patterns(shape)[ordered_rows(Hadamard(shape), order)]
    reported = [counted(row) for row in rows]
    assert (np.diff(reported) > -1e-12).all()
    assert reported[0] < reported[-1]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_separable_walsh_transform_counts_along_first(shape):
    rows = patterns(shape)[ordered_rows(Hadamard(shape), "walsh-2d")]
    height, width = shape
    assert changes(rows, 1).tolist() == np.repeat(np.arange(height), width).tolist()
    assert changes(rows, 2).tolist() == np.tile(np.arange(width), height).tolist()


@pytest.mark.parametrize("shape", SHAPES)
def test_dyadic_patterns_are_products_of_rademacher_functions(shape):
    rows = patterns(shape)[ordered_rows(Hadamard(shape), "dyadic")].reshape(-1, shape[0] * shape[1])
    size = len(rows)
    position = np.arange(size)
    for number, row in enumerate(rows):
        expected = np.ones(size)
        for digit in range(size.bit_length() - 1):
            if number >> digit & 1:
                expected *= 1 - 2 * (position * 2 ** (digit + 1) // size % 2)
        assert np.array_equal(row, expected)


def test_zig_zag_is_the_scan_of_jpeg():
    rows = patterns((8, 8))[ordered_rows(Hadamard((8, 8)), "zig-zag")]
    scan = list(zip(changes(rows, 1), changes(rows, 2), strict=True))
    assert scan[:10] == [
        (0, 0), (0, 1), (1, 0), (2, 0), (1, 1), (0, 2), (0, 3), (1, 2), (2, 1), (3, 0)
    ]  # fmt: skip
    steps = np.abs(np.diff(scan, axis=0))
    assert steps.max() == 1  # always to a neighbour, as its table has it


@pytest.mark.parametrize(("shape", "halvings"), [((16, 16), 4), ((8, 32), 3), ((32, 4), 2)])
def test_russian_dolls_hold_every_coarser_image_complete(shape, halvings):
    """Their first rows span exactly the images whose pixels are blocks of 2 x 2, 4 x 4, ..."""
    rows = patterns(shape)[ordered_rows(Hadamard(shape), "russian-dolls")]
    for halving in range(halvings + 1):
        block = 2**halving
        coarse = rows[: shape[0] * shape[1] // block**2]
        grown = np.kron(coarse[:, ::block, ::block], np.ones((block, block)))
        assert np.array_equal(grown, coarse)


def test_russian_dolls_show_within_a_quarter_few_blocks_first():
    rows = patterns((16, 16))[ordered_rows(Hadamard((16, 16)), "russian-dolls")]
    for quarter in (rows[64:128], rows[128:192], rows[192:]):
        assert (np.diff([blocks(row) for row in quarter]) >= 0).all()
    assert changes(rows[64:128], 1).max() < 8 <= changes(rows[64:128], 2).min()
    assert changes(rows[128:192], 2).max() < 8 <= changes(rows[128:192], 1).min()


def test_random_orders_follow_their_seed_alone():
    basis = Hadamard((8, 8))
    first, again, other = (ordered_rows(basis, f"random:{seed}") for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert np.count_nonzero(first != other) > 32
    plain = BASES["dense"](np.full((30, 2, 2), 0.5))
    assert sorted(ordered_rows(plain, "random:1")) == list(range(30))


@pytest.mark.parametrize(
    ("order", "message"),
    [
        ("random", "pattern order 'random': add a seed after a colon.*such as random:1"),
        ("random:x", "pattern order 'random:x': add a seed"),
        ("random:-1", "'random:-1': add a seed after a colon, a whole number from 0"),
        ("natural:1", "pattern order 'natural' takes no seed, got '1'"),
        ("rondom:1", "unknown pattern order 'rondom': did you mean 'random'"),
    ],
)
def test_seeds_are_asked_for_where_they_are_needed(order, message):
    with pytest.raises(InputError, match=message):
        make_plan((4, 4), 4, order)


# Bases by name


def test_fourier_patterns_are_the_discrete_fourier_transform():
    """Pairs of coefficients, the four phase steps, are its real and imaginary parts."""
    for shape in ((4, 6), (5, 3), (1, 8)):
        basis = BASES["fourier"](shape)
        image = np.random.default_rng(0).random(shape)
        rows = basis.matrix(np.arange(basis.rows))
        assert np.abs(rows).max() <= 1
        assert np.linalg.matrix_rank(rows) == basis.rows
        result = rows @ image.ravel()
        spectrum = np.fft.fft2(image)
        number = np.arange(basis.rows).reshape(shape)
        conjugate = np.roll(number[::-1, ::-1], 1, axis=(0, 1))
        expected = []
        for bin_ in np.flatnonzero(number.ravel() <= conjugate.ravel()):
            value = spectrum.flat[bin_]
            expected += [value.real] if bin_ == conjugate.flat[bin_] else [value.real, value.imag]
        np.testing.assert_allclose(result, expected, atol=1e-12)


def test_fourier_orders_keep_the_four_steps_together():
    rows = ordered_rows(BASES["fourier"]((8, 8)))
    vertical, horizontal = BASES["fourier"]((8, 8)).sign_changes
    assert rows[:3].tolist() == [0, 1, 2]
    assert (np.diff(vertical[rows] ** 2 + horizontal[rows] ** 2) >= 0).all()


def floyd_steinberg(grey):
    """One image, pixel by pixel, as the paper says it."""
    left, (height, width) = grey.copy(), grey.shape
    for y in range(height):
        for x in range(width):
            old, left[y, x] = left[y, x], 1 if left[y, x] >= 0 else -1
            for dy, dx, fraction in ((0, 1, 7), (1, -1, 3), (1, 0, 5), (1, 1, 1)):
                if y + dy < height and 0 <= x + dx < width:
                    left[y + dy, x + dx] += (old - left[y, x]) * fraction / 16
    return left


def test_dithered_patterns_are_black_and_white_and_their_dots_fine():
    shape = (32, 32)
    grey, binary = (BASES[name](shape) for name in ("fourier", "fourier-binary"))
    few = ordered_rows(grey)[:9]
    smooth, dots = (basis.matrix(few).reshape(-1, *shape) for basis in (grey, binary))
    assert (dots[0] == 1).all()
    for cosine, displayed in zip(smooth, dots, strict=True):
        assert np.array_equal(displayed, floyd_steinberg(cosine))
    power = np.mean(np.abs(np.fft.fft2(dots - smooth)) ** 2, axis=0)
    assert 10 * power[1:5, 1:5].mean() < power[12:17, 12:17].mean()


def test_scrambled_patterns_are_hadamard_patterns_with_their_pixels_elsewhere():
    plan = make_plan((4, 8), basis="scrambled:5", polarity="signed")
    basis = plan.patterns
    rows = basis.matrix(np.arange(32))
    assert np.array_equal(rows[:, basis.permutation], hadamard(32))
    image = np.random.default_rng(0).random(32)
    np.testing.assert_allclose(basis.project(image, plan.index), rows @ image)
    np.testing.assert_allclose(basis.combine(image, plan.index), rows.T @ image)
    with pytest.raises(InputError, match=r"permutation of 4 numbers: must contain 0\.\.3"):
        BASES["scrambled"]((2, 2), [0, 1, 2, 2])
    with pytest.raises(InputError, match="pattern basis 'scrambled': add a seed"):
        make_plan((4, 8), basis="scrambled")
    with pytest.raises(InputError, match="pattern basis 'dense': needs patterns; pass a basis"):
        make_plan((4, 8), basis="dense")


@pytest.mark.parametrize("shape", [(8, 8), (4, 16), (16, 2)])
def test_the_most_varying_rows_come_first(shape):
    """Of images with the covariance that the order names, by the whole matrix of it."""
    rows = patterns(shape)[ordered_rows(Hadamard(shape), "variance-ranked")]
    rows = rows.reshape(shape[0] * shape[1], -1)
    y, x = (np.ravel(each) for each in np.indices(shape))
    distance = np.abs(np.subtract.outer(y, y)) / DOWN + np.abs(np.subtract.outer(x, x)) / ALONG
    covariance = np.exp(-distance / max(shape))
    variance = np.einsum("ku,uv,kv->k", rows, covariance, rows)[1:]
    assert (np.diff(variance) < 1e-9 * variance[0]).all()
