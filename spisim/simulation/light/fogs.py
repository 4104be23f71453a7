"""Light of a scene in fogs of several visibilities, from as few passes as pay."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from reconstruction.base.errors import InputError
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light.other_fog import MIN_CARRIED, OtherFog
from spisim.simulation.light.solve import Transport, solve_fogs
from spisim.transport.engine.outputs import Outputs

#: Maximum number of other fogs of one pass: each has its sums, which cost time.
MAX_OTHERS = 3
#: Typical length of the paths that return, m, by which fogs out of range are left out of a pass.
TYPICAL_LENGTH_M = 10.0


def trace_fogs(
    scenes: Sequence[Scene],
    instrument: Instrument,
    *,
    transport_noise_share: float,
    seeds: Sequence[int],
) -> tuple[Transport, ...]:
    """Light of one scene in several fogs of the same droplets.

    The thickest fog is traced, because its light has the largest error beside the detectors' noise.
    Thinner ones follow from its paths, if at least `MIN_CARRIED` of them carry the light there and
    its error is as small as ordered. Of the others the thickest is traced next.

    Parameters
    ----------
    scenes
        Equal but for the number of droplets; nothing in them moves.
    instrument, transport_noise_share
        As of `solve`.
    seeds
        Of each scene, for a pass through its fog.

    Returns
    -------
    tuple of Transport
        In the order of `scenes`; `reweighted` of those that were not traced says how they follow.

    Raises
    ------
    InputError
        As `solve` and `OtherFog.between`.
    """
    outputs = Outputs(frequencies_hz=instrument.tap_frequencies_hz)
    extinction = [scene.atmosphere.extinction_per_m for scene in scenes]
    left = sorted(range(len(scenes)), key=lambda k: -extinction[k])
    lights: dict[int, Transport] = {}
    while left:
        traced, *thinner = left
        near = [k for k in thinner if _promising(extinction[traced], extinction[k])][:MAX_OTHERS]
        others = [OtherFog.between(scenes[traced], scenes[k]) for k in near]
        own, *rest = _pass(
            scenes[traced], instrument, others, transport_noise_share, seeds[traced], outputs
        )
        lights[traced] = own
        for number, light in zip(near, rest, strict=False):  # none if it had to be traced alone
            if _is_good(light, transport_noise_share):
                lights[number] = light
        left = [number for number in left if number not in lights]
    return tuple(lights[number] for number in range(len(scenes)))


def _pass(
    scene: Scene,
    instrument: Instrument,
    others: Sequence[OtherFog],
    noise_share: float,
    seed: int,
    outputs: Outputs,
) -> tuple[Transport, ...]:
    """Light in all fogs; in the scene's own alone if there is more than weighted sums can hold."""
    how = {"transport_noise_share": noise_share, "seed": seed, "outputs": outputs}
    if others:
        with suppress(InputError):
            return solve_fogs(scene, instrument, others, **how)
    return solve_fogs(scene, instrument, (), **how)


def _promising(traced_per_m: float, other_per_m: float) -> bool:
    """Whether enough paths would carry, if their scatterings were Poisson distributed."""
    depth = TYPICAL_LENGTH_M * (other_per_m - traced_per_m) ** 2 / traced_per_m
    return bool(np.exp(-depth) >= MIN_CARRIED)


def _is_good(light: Transport, noise_share: float) -> bool:
    """Whether the light is carried by enough paths, and its errors are as ordered."""
    assert light.reweighted is not None
    carried = light.reweighted.carried >= MIN_CARRIED
    return carried and not (light.noise_share > noise_share or light.spot_noise_share > noise_share)
