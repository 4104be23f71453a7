"""Empirical extinction laws by visibility, for comparison with Mie theory.

All but Al Naboulsi's are σ = 3.912/V · (λ / 550 nm)^-q. P. W. Kruse et al., Elements of Infrared
Technology (1962); I. I. Kim, B. McArthur & E. Korevaar, Proc. SPIE 4214, 26 (2001); M. Al Naboulsi,
H. Sizun & F. de Fornel, Opt. Eng. 43, 319 (2004); M. Ijaz et al., J. Lightwave Technol. 31, 1720
(2013), measured in a chamber.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType
from typing import NamedTuple

from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere.visibility import extinction_at_550nm, visibility


def _kruse(visibility_km: float, _: float) -> float:
    if visibility_km > 50:
        return 1.6
    return 1.3 if visibility_km > 6 else 0.585 * visibility_km ** (1 / 3)


def _kim(visibility_km: float, _: float) -> float:
    if visibility_km > 6:
        return _kruse(visibility_km, _)
    if visibility_km > 1:
        return 0.16 * visibility_km + 0.34
    return max(visibility_km - 0.5, 0)


def _by_exponent(exponent: Callable[[float, float], float]) -> Callable[[float, float], float]:
    """Extinction (1/m) by visibility (m) and wavelength (µm), from q by km and µm."""

    def extinction(visibility_m: float, wavelength_um: float) -> float:
        q = exponent(visibility_m / 1e3, wavelength_um)
        return float(extinction_at_550nm(visibility_m) * (wavelength_um / 0.55) ** -q)

    return extinction


class Model(NamedTuple):
    """An empirical law and the range of its fit."""

    extinction: Callable[[float, float], float]  # 1/m, of visibility in m and wavelength in µm
    visibility_m: tuple[float, float]
    wavelength_um: tuple[float, float]
    medium: str = "fog"


MODELS: Mapping[str, Model] = MappingProxyType(
    {
        # For haze. In fog too optimistic at longer wavelengths.
        "kruse": Model(_by_exponent(_kruse), (1e3, 1e5), (0.4, 2.4)),
        "kim": Model(_by_exponent(_kim), (10, 1e5), (0.55, 1.7)),
        "al-naboulsi-advection": Model(
            lambda v, um: (0.11478 * um + 3.8367) / v, (50, 1e3), (0.69, 1.55)
        ),
        "al-naboulsi-radiation": Model(
            lambda v, um: (0.18126 * um**2 + 0.13709 * um + 3.7502) / v, (50, 1e3), (0.69, 1.55)
        ),
        "ijaz-fog": Model(_by_exponent(lambda _, um: 0.1428 * um - 0.0947), (15, 1e3), (0.6, 1.55)),
        "ijaz-smoke": Model(
            _by_exponent(lambda _, um: 0.8467 * um - 0.5212), (15, 1e3), (0.6, 1.55), "smoke"
        ),
    }
)


def empirical_extinction(name: str, visibility_m: float, wavelength_nm: float = 1550.0) -> float:
    """Extinction, 1/m, by the empirical model of this name.

    Parameters
    ----------
    name : str
        Name in `MODELS`.
    visibility_m : float
        By Koschmieder's definition.
    wavelength_nm : float

    Raises
    ------
    InputError
        For another name, and outside the range of the model's fit.
    """
    if name not in MODELS:
        raise InputError(f"empirical model {name!r}: {nearest(name, MODELS)}")
    model, wavelength_um = MODELS[name], wavelength_nm / 1e3
    for field, value, (low, high) in (
        ("visibility_m", visibility_m, model.visibility_m),
        ("wavelength_nm", wavelength_nm, tuple(1e3 * um for um in model.wavelength_um)),
    ):
        if not low <= value <= high:
            raise InputError(f"{name} holds for {field} from {low:g} to {high:g}; found {value:g}")
    return model.extinction(visibility_m, wavelength_um)


def all_extinctions(
    visibility_m: float,
    definition: str = "koschmieder",
    wavelength_nm: float = 1550.0,
    medium: str = "fog",
) -> dict[str, float]:
    """Extinction, 1/m, by each empirical model valid for medium, visibility and wavelength."""
    equal_m = visibility(extinction_at_550nm(visibility_m, definition))
    result = {}
    for name in (each for each, model in MODELS.items() if model.medium == medium):
        with suppress(InputError):
            result[name] = empirical_extinction(name, equal_m, wavelength_nm)
    return result
