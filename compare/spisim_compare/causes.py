"""What may make two captures differ, each as directions along which the readings change."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.base.arrays import Floats, Mask

from .midpoint import Midpoint
from .patterns import constant, exposed

FACTOR = "factor"
"""Parameter that is a relative change of the mean of both captures,"""
EXTINCTION = "extinction_per_m"
"""and that of fog."""
MAX_RELATIVE = {FACTOR: 1.9, EXTINCTION: 4.0}
"""Maximum changes over the mean; that of fog is an estimate, so twice the possible is allowed."""
SURFACES_DIMMED = 0.3
"""Damping of the image per that of single paths: light that fog scatters forward still arrives."""
SURFACES_UNSURE = 0.15
ECHO_UNSURE = 0.15
"""Relative error of the fog's echo: kinds of droplets, and light scattered more than once."""
SPOT_UNSURE = 0.1
"""Relative error of the change of a spot's readings by fog."""
DAYLIGHT_UNSURE = 0.15
"""Relative change of steady light per relative change of extinction."""
MIN_EXTINCTION_PER_M = 0.005
FOG_PER_M, FOG_ODDS = 0.01, 10.0
"""Extinction of air that is foggy, and how much likelier another fog is there than another cause:
fog changes within minutes, powers and mounts hardly in months."""
TURNED_UNSURE = 0.35
"""Relative error of the change of readings by a turn: what an image of few patterns hides."""
ELSEWHERE_PER_DEG = 2.0
"""Relative change of the readings of a spot per degree of a turn: it may meet something else."""
TURNED_SCALES = (0.02, 0.15, 1.0)
"""Of it: a spot may stay on an even wall, on a slope, or leave what it met."""
STEADY_PER_DEG = 0.6
"""Relative change of steady light per degree of a turn."""


@dataclass(frozen=True, eq=False)
class Cause:
    """A cause and its directions (n, k), of change per unit of each parameter.

    ``unsure`` (n, r) are standard deviations per unit of the norm of all parameters: what the cause
    changes, but by an amount that is not known. ``loose`` are relative errors of the change of all
    readings of patterns, and of all those of spots. Of several ``scales``, the likeliest multiplies
    ``unsure``. ``level`` is the value half way of what the parameter changes, if known, and
    ``odds`` how likely the cause is a priori beside others. Causes of one ``family`` are kinds of
    one thing.
    """

    name: str
    family: str
    parameters: tuple[str, ...]
    directions: Floats
    unsure: Floats
    loose: float = 0.0
    level: float = np.nan
    scales: tuple[float, ...] = (1.0,)
    odds: float = 1.0

    def allows(self, theta: Floats) -> bool:
        """Whether parameters are possible: light and fog are not negative in either capture."""
        levels = {FACTOR: 1.0, EXTINCTION: self.level}
        return not any(
            abs(x) > MAX_RELATIVE[name] * levels[name]
            for name, x in zip(self.parameters, theta.tolist(), strict=True)
            if name in MAX_RELATIVE
        )

    def only(self, readings: Mask) -> "Cause":
        """The cause on some of the readings."""
        return replace(self, directions=self.directions[readings], unsure=self.unsure[readings])


class Causes:
    """Causes that can be inferred from the readings of two captures: of patterns, then of spots."""

    def __init__(self, at: Midpoint) -> None:
        self._at = at
        self._plans = at.simulated.setup.plans
        self._images = at.simulated.plan.shows_image
        self._patterns = at.patterns.size
        self._spots = 0 if at.spots is None else at.spots.variance.size
        self._on = constant(self._plans)

    def __call__(self) -> list[Cause]:
        """All that suit the captures."""
        causes = [*self._powers(), *self._steady(), self._fog(), self._pointing()]
        return [each for each in causes if each is not None]

    def _both(self, patterns: Floats | None, spots: Floats | None) -> Floats:
        """Columns of changes of patterns and of spots, side by side in one array (n, k)."""
        given = patterns if patterns is not None else spots
        assert given is not None
        columns = np.zeros((self._patterns + self._spots, given.shape[1]))
        if patterns is not None:
            columns[: self._patterns] = patterns
        if spots is not None:
            columns[self._patterns :] = spots
        return columns

    def _powers(self) -> list[Cause]:
        nothing = np.zeros((self._patterns + self._spots, 0))
        projector = lasers = None
        unsure = nothing
        causes = []
        if self._images:
            projector = self._both(
                (self._at.patterns - self._on * self._at.background)[:, None], None
            )
            causes.append(Cause("projector power", "power", (FACTOR,), projector, nothing))
        if self._at.spots is not None:
            lasers = self._both(None, self._at.spots.echo[:, None])
            unsure = self._both(None, self._at.spots.echo_unsure)
            causes.append(Cause("laser power", "power", (FACTOR,), lasers, unsure))
        if projector is not None and lasers is not None:
            causes.append(Cause("power", "power", (FACTOR,), projector + lasers, unsure))
        return causes

    def _steady(self) -> list[Cause]:
        nothing = np.zeros((self._patterns + self._spots, 0))
        causes, columns, names = [], [], []
        if self._images and self._on.any():
            offset = self._both(self._on[:, None], None)
            causes.append(Cause("offset", "offset", ("electrons",), offset, nothing))
            columns, names = [offset], ["electrons per pattern"]
        if self._at.spots is not None:
            columns.append(self._both(None, self._at.spots.steady[:, None]))
            names.append("electrons per reading of spots")
            both = np.hstack(columns)
            causes.append(Cause("background", "background", tuple(names), both, nothing))
        return causes

    def _fog(self) -> Cause | None:
        of_spots = self._at.spots_in_fog
        dimmed, echo = self._at.image_in_fog
        main = np.zeros((self._patterns + self._spots, 1))
        unsure = []
        extinction = MIN_EXTINCTION_PER_M
        if of_spots is not None:
            extinction = max(extinction, of_spots.extinction_per_m)
            main += self._both(None, (of_spots.damped + of_spots.backscattered)[:, None])
            unsure.append(self._both(None, ECHO_UNSURE * of_spots.backscattered[:, None]))
        elif self._at.spots is not None:
            unsure.append(self._both(None, self._at.spots.elsewhere / extinction))
        if self._images:
            of_surfaces, of_echo = (exposed(self._plans, each)[:, None] for each in (dimmed, echo))
            main += self._both(SURFACES_DIMMED * of_surfaces + of_echo, None)
            unsure.append(
                self._both(np.hstack([SURFACES_UNSURE * of_surfaces, ECHO_UNSURE * of_echo]), None)
            )
            steady = abs(self._at.background) * self._on[:, None]
            unsure.append(self._both(DAYLIGHT_UNSURE / extinction * steady, None))
        if self._at.spots is not None:
            steady = DAYLIGHT_UNSURE / extinction * self._at.spots.steady_of_spots
            unsure.append(self._both(None, steady))
        if not main.any():
            return None
        level = np.nan if self._at.fog is None else self._at.fog.extinction_per_m
        odds = FOG_ODDS if level > FOG_PER_M else 1.0
        unsure_of_all = np.hstack(unsure)
        return Cause(
            "fog", "fog", (EXTINCTION,), main, unsure_of_all, SPOT_UNSURE, level, odds=odds
        )

    def _pointing(self) -> Cause | None:
        turned = self._at.turned_per_deg if self._images else None
        if turned is None:
            return None
        main = self._both(turned, None)
        unsure = [self._both(STEADY_PER_DEG * abs(self._at.background) * self._on[:, None], None)]
        if self._at.spots is not None:
            unsure.append(self._both(None, ELSEWHERE_PER_DEG * self._at.spots.elsewhere))
        return Cause(
            "pointing",
            "pointing",
            ("down_deg", "right_deg"),
            main,
            np.hstack(unsure),
            TURNED_UNSURE,
            scales=TURNED_SCALES,
        )
