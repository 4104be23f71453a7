"""Further echoes in a histogram: a twig before the wall, a pane before the room, an edge.

Arrivals beyond the fitted target and fog are searched for further pulses. Echoes that cannot be
resolved widen the single pulse and increase the sigma of its range.
"""

from dataclasses import replace

import numpy as np

from ...base.arrays import Floats
from ..histogram import coates
from ..ranges import Alternative
from .histograms import HistogramTemplates
from .modes import MIN_RANGE_M
from .posterior import SpotPosterior

MIN_DEVIANCE = 30.0
"""Minimum deviance of an echo: fewer than one histogram in a thousand exceeds it by chance."""
MIN_ARRIVALS = 5.0
"""Minimum arrivals of an echo,"""
MIN_RELATIVE_SIGNAL = 0.02
"""and minimum light relative to the likeliest one."""
UNEVEN = 0.5
"""Relative excess density of patches of fog."""
STEADY = 0.9
"""Fraction of the bins that hold only background, whatever the echoes."""
MAX_ECHOES = 4
"""Maximum number of echoes of a spot."""
MIN_EXCESS_WIDTH = 4.0
"""Standard deviations by which a pulse must be too wide to count as several echoes."""


def with_echoes(
    posterior: SpotPosterior, templates: HistogramTemplates, counts: Floats, cycles: int, spot: int
) -> SpotPosterior:
    """Posterior of a spot with a histogram (B,), all its echoes considered.

    Echoes become alternatives weighted by their fraction of the light, the likeliest range first.
    """
    if not posterior.alternatives:
        return posterior
    rate, watched = coates(counts[None], cycles)
    first = posterior.alternatives[0]
    around = _Around(templates, spot, watched[0])
    result = [(first.range_m, first.sigma_m, posterior.signal)]
    pulse = around.pulse(*result[0])
    fog = posterior.backscatter * templates.fog[spot, posterior.node]
    steady = np.sort(rate[0] - fog - pulse)[: int(STEADY * counts.size)].mean()
    model = fog + pulse + max(steady, 0.5 / cycles / counts.size)
    spread_m = around.excess_width_m(rate[0] - model + pulse, result[0], model)
    while len(result) < MAX_ECHOES:
        echo = around.strongest(
            rate[0], model, UNEVEN * fog + MIN_RELATIVE_SIGNAL * posterior.signal / around.window
        )
        if echo is None:
            break
        result.append(echo)
        model = model + around.pulse(*echo)
    if len(result) == 1 and not spread_m:
        return posterior
    fractions = np.array([signal for *_, signal in result])
    fractions = fractions / fractions.sum()
    echoes = [
        Alternative(range_m, sigma_m, float(fraction))
        for (range_m, sigma_m, _), fraction in zip(result, fractions, strict=True)
    ]
    echoes[0] = echoes[0]._replace(sigma_m=float(np.hypot(first.sigma_m, spread_m)))
    return replace(posterior, alternatives=tuple(echoes), echoes=len(echoes))


class _Around:
    """Pulses in the bins of a spot."""

    def __init__(self, templates: HistogramTemplates, spot: int, watched: Floats) -> None:
        self._range_m = templates.range_m
        self._delay = templates.delay[spot]
        self._shape, self._width = templates.shape, templates.shape.width
        self._watched = watched
        self._metres = np.gradient(templates.range_m, self._delay)[-1]  # per bin
        self.window = templates.window
        self._nearest = int(np.interp(MIN_RANGE_M, templates.range_m, self._delay))

    def pulse(self, range_m: float, _sigma_m: float, signal: float) -> Floats:
        """Arrivals per cycle (B,) of an echo."""
        edges = np.arange(self._watched.size + 1) - np.interp(range_m, self._range_m, self._delay)
        return np.asarray(signal * np.diff(self._shape.arrived(edges)))

    def strongest(
        self, rate: Floats, model: Floats, minimum: Floats
    ) -> tuple[float, float, float] | None:
        """Range, sigma and arrivals of the strongest echo beyond a model, if any.

        It has more than ``minimum`` (B,) arrivals per cycle in the bins of its window.
        """
        from scipy.ndimage import uniform_filter1d  # slow to import

        result, expected, needed = (
            self.window * uniform_filter1d(self._watched * each, self.window, mode="constant")
            for each in (rate, model, minimum)
        )
        more = np.where(result - expected > np.maximum(needed, MIN_ARRIVALS), result, expected)
        deviance = 2 * (more * np.log(more / expected) - (more - expected))
        deviance[: self._nearest] = 0
        index = int(deviance.argmax())
        arrivals = float(result[index] - expected[index])
        if deviance[index] < MIN_DEVIANCE:
            return None
        around = self._shape.arrived(self.window / 2 * np.array([-1.0, 1.0]))
        inside = float(around[1] - around[0])  # fraction of a pulse in the window
        at = slice(max(index - self.window // 2, 0), index + self.window // 2 + 1)
        excess = np.maximum((rate - model)[at], 0)
        centre = float(excess @ (np.arange(rate.size)[at] + 0.5) / excess.sum())
        sigma = self._width * np.sqrt(result[index]) / arrivals
        signal = arrivals / inside / float(self._watched[index])
        range_m = float(np.interp(centre, self._delay, self._range_m))
        return range_m, float(sigma * self._metres), signal

    def excess_width_m(
        self, pulse: Floats, echo: tuple[float, float, float], model: Floats
    ) -> float:
        """Excess width of a pulse (B,) over that of an echo, 0 if it may be chance."""
        centre = np.interp(echo[0], self._range_m, self._delay)
        offset = np.arange(pulse.size) + 0.5 - centre
        at = np.abs(offset) < 3 * self._width
        light = pulse[at].sum()
        if light <= 0:
            return 0.0
        squares = float(pulse[at] @ offset[at] ** 2 / light)
        bell = self.pulse(*echo)[at]
        expected = float(bell @ offset[at] ** 2 / bell.sum())
        noise = np.sqrt(model[at] / self._watched[at] @ (offset[at] ** 2 - expected) ** 2) / light
        if squares - expected < MIN_EXCESS_WIDTH * noise:
            return 0.0
        return float(np.sqrt(squares - expected) * self._metres)
