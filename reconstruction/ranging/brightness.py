"""Brightness of the reconstructed image at the spots."""

from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from ..capture import Optics, Spots
from ..capture.spots import SpotOptics

NEIGHBOURS = 1
"""Pixels averaged on each side of a spot."""


class Brightness(NamedTuple):
    """Electrons of a pixel, fully on, at the spots, (spots,), and sigmas; nan outside the image."""

    electrons: Floats
    sigma: Floats


def brightness_at(positions: Floats, image: Floats, sigma: Floats) -> Brightness:
    """Brightness at ``positions`` (spots, 2), row and column, of an image (H, W) in electrons.

    Errors of neighbouring pixels are correlated, so the mean is no more certain than one pixel.
    """
    electrons, electrons_sigma = np.full((2, len(positions)), np.nan)
    for spot, (row, column) in enumerate(np.rint(positions).astype(int)):
        if 0 <= row < image.shape[0] and 0 <= column < image.shape[1]:
            around = tuple(
                slice(max(at - NEIGHBOURS, 0), at + NEIGHBOURS + 1) for at in (row, column)
            )
            of_image, of_sigma = image[around], sigma[around]
            electrons[spot] = of_image.sum() / of_image.size
            electrons_sigma[spot] = of_sigma.sum() / of_sigma.size
    return Brightness(electrons, electrons_sigma)


def bucket_optics(optics: Optics | None, spots: Spots) -> tuple[SpotOptics, ...]:
    """Optics of the bucket detector's photodiodes along the spots' rays.

    Empty if the recording does not state their fields or the brightness of the pixels.
    """
    if (
        optics is None
        or not np.isfinite(
            [
                np.mean(optics.pixel_electrons),
                optics.detector_half_field_rad,
                optics.detector_falloff,
                optics.detector_aperture_radius_m,
                *optics.detector_positions_m.ravel(),
            ]
        ).all()
    ):
        return ()
    count = len(spots.directions)
    return tuple(
        SpotOptics(
            directions=spots.directions,
            detector_positions_m=np.tile(position, (count, 1)),
            detector_axes=np.tile([0.0, 0.0, 1.0], (count, 1)),
            half_fields_rad=np.full(count, optics.detector_half_field_rad),
            falloffs=np.full(count, optics.detector_falloff),
            aperture_radii_m=np.full(count, optics.detector_aperture_radius_m),
            beam_divergence_rad=0.0,
            beam_waist_m=0.0,
        )
        for position in optics.detector_positions_m
    )
