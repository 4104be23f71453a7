"""Whether the spots share one even fog, and their posterior if that is uncertain.

Banks, clouds and patches lie before some spots and not before others. So readings are fitted with a
second model as well: each spot has a fog of its own, whose density along the beam deviates `ROUGH`
times as much. Either model is as probable as its evidence makes it, and so are its alternatives
(Bayesian model averaging; J. Hoeting et al., Statistical Science 14, 1999).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .fog_state import FogState
from .modes import Modes
from .posterior import Posterior, SpotPosterior, joined, posterior

ROUGH = 4.0
"""Deviation of the density along the beams of an uneven fog, over the usual one."""
UNEVEN = 0.2
"""Prior probability of uneven fog."""
EDGE = 0.1
"""Prior probability that a spot is on an edge."""
STANDS_OUT = 20.0
"""Minimum strength of targets in uneven fog, in standard deviations; weaker ones may be fog."""


def probability_of_uneven(log_ratio: float) -> float:
    """Probability of uneven fog from the logarithm of its evidence over that of even fog."""
    odds = np.exp(np.clip(log_ratio, -500, 500)) * UNEVEN / (1 - UNEVEN)
    return float(odds / (1 + odds))


def averaged(
    even: Posterior, rough: Modes, prior: FogState, edges: Sequence[int]
) -> tuple[SpotPosterior, ...]:
    """Posterior of the spots from that of an even fog, and the modes in rough fog.

    Spots on ``edges`` remain as they are: in even fog two targets explain them as well as uneven
    fog does, but edges are rare.
    """
    numbers = [number for number in range(len(even.spots)) if number not in edges]
    own = {n: posterior(rough.only(rough.spot == n), prior, n + 1) for n in numbers}
    log_own = sum(each.log_evidence for each in own.values())
    log_even = even.log_evidence + len(edges) * np.log(EDGE)
    uneven = probability_of_uneven(log_own - log_even)
    return tuple(
        mixed(spot, own[number].spots[number], uneven) if number in own else spot
        for number, spot in enumerate(even.spots)
    )


def mixed(even: SpotPosterior, own: SpotPosterior, uneven: float) -> SpotPosterior:
    """Mixture of two posteriors, the second with the probability ``uneven``."""
    parts = ((even, 1 - uneven), (own, uneven))
    rows = [
        [each.range_m, each.sigma_m**2, probability * spot.target * each.weight]
        for spot, probability in parts
        for each in spot.alternatives
        if probability > 0
    ]
    likeliest = own if uneven > 0.5 else even
    return replace(
        likeliest,
        alternatives=joined(rows) if rows else (),
        target=sum(probability * spot.target for spot, probability in parts),
        needed=STANDS_OUT if uneven > 0.5 else likeliest.needed,
        uneven=uneven,
    )
