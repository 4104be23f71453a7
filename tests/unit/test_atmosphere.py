"""Fog by visibility gives the extinction of Mie theory and of both definitions of visibility."""

import math

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim import atmosphere


@pytest.mark.parametrize(
    ("kind", "by_visibility"),
    [  # 1/m at 1550 nm, from Mie theory with the droplets of Shettle & Fenn
        ("heavy-advection", {10: 0.4027, 20: 0.2013, 50: 0.0805, 100: 0.0403, 200: 0.0201}),
        ("moderate-advection", {10: 0.4047, 20: 0.2023, 50: 0.0809, 100: 0.0405, 200: 0.0202}),
        ("heavy-radiation", {10: 0.4169, 20: 0.2084, 50: 0.0834, 100: 0.0417, 200: 0.0208}),
        ("moderate-radiation", {10: 0.4466, 20: 0.2233, 50: 0.0893, 100: 0.0447, 200: 0.0223}),
    ],
)
def test_extinction_matches_mie_table(kind: str, by_visibility: dict[int, float]) -> None:
    for visibility_m, extinction in by_visibility.items():
        assert atmosphere.fog(visibility_m, kind).extinction_per_m == pytest.approx(
            extinction, abs=6e-5, rel=5e-4
        )


def test_visibility_definitions_differ_by_their_contrast() -> None:
    koschmieder = atmosphere.extinction_at_550nm(100, "koschmieder")
    mor = atmosphere.extinction_at_550nm(100, "mor")
    assert koschmieder == pytest.approx(0.03912, rel=1e-4)
    assert mor == pytest.approx(0.02996, rel=1e-4)
    assert koschmieder / mor == pytest.approx(math.log(0.02) / math.log(0.05))


def test_albedo_and_asymmetry_do_not_change_with_visibility() -> None:
    thin, thick = (atmosphere.fog(v, "heavy-radiation") for v in (200, 10))
    assert (thin.albedo, thin.g) == (thick.albedo, thick.g)
    np.testing.assert_array_equal(thin.phase.values, thick.phase.values)


def test_scattering_and_absorption_add_up() -> None:
    air = atmosphere.fog(20, "heavy-advection")
    assert air.scattering_per_m + air.absorption_per_m == pytest.approx(air.extinction_per_m)
    assert air.absorption_per_m == pytest.approx(0.2013 * (1 - 0.98104), rel=1e-2)


def test_explicit_medium_is_taken_as_given() -> None:
    air = atmosphere.explicit(0.3, 0.9, atmosphere.HenyeyGreenstein(-0.2))
    assert (air.extinction_per_m, air.albedo, air.g, air.visibility_m) == (0.3, 0.9, -0.2, None)
    assert atmosphere.CLEAR.extinction_per_m == 0


@pytest.mark.parametrize("visibility_m", [0, -50, math.inf, math.nan])
def test_impossible_visibility(visibility_m: float) -> None:
    with pytest.raises(InputError, match="visibility_m"):
        atmosphere.fog(visibility_m, "heavy-advection")


def test_unknown_names_point_to_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'heavy-advection'"):
        atmosphere.fog(50, "heavy-advektion")
    with pytest.raises(InputError, match="did you mean 'koschmieder'"):
        atmosphere.fog(50, "heavy-advection", "kosmieder")


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ((-0.1, 1), "extinction_per_m"),
        ((math.nan, 1), "extinction_per_m"),
        ((math.inf, 1), "extinction_per_m"),
        ((1e9, 1), "extinction_per_m should be 0 to 10000"),
        ((0.1, 1.2), "albedo"),
        ((0.1, math.nan), "albedo"),
    ],
)
def test_impossible_coefficients(values: tuple[float, float], field: str) -> None:
    with pytest.raises(InputError, match=field):
        atmosphere.explicit(*values, atmosphere.Isotropic())
