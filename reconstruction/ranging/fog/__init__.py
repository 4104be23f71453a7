"""Ranges through fog: joint fit of the spots and the fog's echo.

For light scattered at most once, the fraction of a laser's energy that reaches its detector over
the path L(r) = r + |r d - b| is

    rho / pi * w(z) exp(-sigma L(z))  from the target at z, and
    beta * w(r) exp(-sigma L(r)) dr   from fog between r and r + dr, in front of it,

with w(r) the aperture's area, cosine, 1/distance^2 and overlap of beam and field (`overlap`), rho
the target's reflectance along its spot, and common to all: sigma, the extinction, and beta,
scattering times phase function at 180 degrees. Multiple scattering is a few percent of the fog's
echo, and shifts the target's phase by less than 1 cm up to 9 m in 50 m of visibility.
"""
