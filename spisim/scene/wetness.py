"""Darkening of rough surfaces by soaking."""

import math

from spisim.atmosphere import refractive_index

#: Water that light crosses between air and grains, one way. With it, the wet-to-dry ratio of 100
#: soils at 1550 nm is that measured by Minasny et al. (2011), Geoderma 167, 118.
FILM_MM = 0.1
#: Refractive index of the grains: quartz, clay, cellulose.
GRAIN_IOR = 1.5


def wet_reflectance(dry: float, wavelength_nm: float) -> float:
    """Diffuse reflectance of a soaked surface from that of the dry one, both 0 to 1.

    The water's surface reflects part of the light back to the grains, and grains absorb more in
    water than in air: Lekner & Dorf (1988), Applied Optics 27, 1278, after Ångström (1925). Water
    absorbs on each pass: the film of Bablet et al. (2018), Remote Sensing of Environment 217, 1.
    The glint of the water, 2 %, counts as diffuse, so surfaces about that dark come out brighter
    than dry. InputError for a wavelength outside 400 to 1700 nm.
    """
    index = refractive_index("water", wavelength_nm)
    water = index.real
    entering = mean_fresnel_transmittance(GRAIN_IOR / water) / mean_fresnel_transmittance(GRAIN_IOR)
    body = 1 - (1 - dry) * (1 - dry + dry * entering)
    absorption_per_mm = 4 * math.pi * -index.imag / (wavelength_nm * 1e-6)
    body *= math.exp(-2 * absorption_per_mm * FILM_MM)
    glint = ((water - 1) / (water + 1)) ** 2
    leaving = mean_fresnel_transmittance(water) / water**2
    return glint + (1 - glint) * leaving * body / (1 - (1 - leaving) * body)


def mean_fresnel_transmittance(ior: float) -> float:
    """Diffuse transmittance of a smooth surface into a relative index above 1.

    Walsh (1926), in the form of Duntley (1942), J. Opt. Soc. Am. 32, 61.
    """
    n, n2, n4 = ior, ior**2, ior**4
    reflected = (
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + n2 * (n2 - 1) ** 2 / (n2 + 1) ** 3 * math.log((n - 1) / (n + 1))
        - 2 * n**3 * (n2 + 2 * n - 1) / ((n2 + 1) * (n4 - 1))
        + 8 * n4 * (n4 + 1) / ((n2 + 1) * (n4 - 1) ** 2) * math.log(n)
    )
    return 1 - reflected
