"""In which layout readings came: which pattern each belongs to, told by the spectrum of images.

A layout is a named order of Hadamard rows and a named sequence of polarities. For each the readings
M are turned, without change of volume, into K coefficients of rows, and M - K sums in which the rows
cancel and which are all alike but for noise and drift. The likelihood of the readings is that of
both: of the coefficients by the spectrum of images (`spectra`), of the sums by a common mean.
"""

from collections.abc import Iterator
from functools import lru_cache
from math import log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import InputError
from ..operators import ORDERS, POLARITIES, PatternPlan, RowOperator, ordered_rows
from ..operators.bases.hadamard import Hadamard
from .spectra import Fit, fit, gaussian, spectra

MAX_FITTED = 2048
"""Coefficients that are looked at; of more, every so many-th."""
MAX_FRAMES = 4
"""Frames of a recording that are looked at."""
TEMPERATURE = 4.0
"""By which differences of log-likelihood are divided: coefficients of one image are not independent,
as the model has them."""
NEGATIVE = 8.0
"""Log-odds against negative counts of displayed light: only an offset taken off makes them."""
UNLIT = "single-ended without dark"
"""A sequence of polarities that tells no background, but may well be what was recorded."""
SEQUENCES = POLARITIES | {UNLIT: lambda rows, _: (rows.astype(np.int32), np.ones(len(rows), np.int8))}


class Layout(NamedTuple):
    """A named order of the rows, a named sequence of polarities, and the plan that they make.

    ``transposed``: the pixels are numbered column by column.
    """

    order: str
    polarity: str
    transposed: bool
    plan: PatternPlan

    def __str__(self) -> str:
        turned = ", transposed" if self.transposed else ""
        return f"order {self.order}, polarity {self.polarity}{turned}"


class Candidate(NamedTuple):
    """A layout and how probable it is among those that were tried.

    ``gain``: by how much the log-likelihood exceeds that of the same polarities with a white
    spectrum, ``likelihood`` the log-likelihood itself, up to a constant of the readings.
    """

    layout: Layout
    probability: float
    likelihood: float
    gain: float


def transposed_rows(rows: NDArray[Any], shape: tuple[int, int]) -> NDArray[np.int32]:
    """Rows of Hadamard patterns of H x W pixels, from those of patterns numbered by columns."""
    height, width = shape
    along, down = np.divmod(np.asarray(rows), height)
    return np.asarray(down * width + along, dtype=np.int32)


def named_plan(
    shape: tuple[int, int], rows: NDArray[Any], polarity: str, order: str, *, transposed: bool
) -> PatternPlan:
    """Plan of rows (K,) of Hadamard patterns in a named sequence of polarities."""
    basis = Hadamard(shape)
    index, sign = SEQUENCES[polarity](transposed_rows(rows, shape) if transposed else rows, 0)
    return PatternPlan(shape, index, sign, order, basis)


def known_layouts(shape: tuple[int, int], exposures: int) -> Iterator[Layout]:
    """All layouts of so many readings, each once."""
    seen = set()
    for transposed in (False, True) if shape[0] != shape[1] else (False,):
        basis = Hadamard(shape[::-1] if transposed else shape)
        for order, _ in ORDERS.loadable():
            try:
                rows = ordered_rows(basis, order)
            except InputError:  # one of other patterns, or with a seed
                continue
            for polarity in SEQUENCES:
                kept = _rows_of(exposures, polarity)
                if not 1 < kept <= len(rows):
                    continue
                plan = named_plan(shape, rows[:kept], polarity, order, transposed=transposed)
                key = plan.index.tobytes(), plan.polarity.tobytes()
                if key not in seen:
                    seen.add(key)
                    yield Layout(order, polarity, transposed, plan)


def _rows_of(exposures: int, polarity: str) -> int:
    """How many rows so many exposures show; 0 where that cannot be."""
    for rows in (exposures, exposures - 1, exposures // 2):
        if rows > 0 and len(SEQUENCES[polarity](np.arange(rows), 0)[0]) == exposures:
            return rows
    return 0


def recognise(readings: NDArray[Any], shape: tuple[int, int]) -> list[Candidate]:
    """Known layouts of readings (frames, M), the most probable first.

    Raises InputError where the shape has no Hadamard patterns, and where no layout has so many
    readings.
    """
    layouts = list(known_layouts(shape, readings.shape[1]))
    if not layouts:
        raise InputError(
            f"no known layout of {shape[0]} x {shape[1]} pixels has {readings.shape[1]} readings"
        )
    fits = [_fit(layout.plan, readings) for layout in layouts]
    likelihoods = np.array([each.image for each in fits])
    weights = np.exp((likelihoods - likelihoods.max()) / TEMPERATURE)
    found = map(Candidate, layouts, weights / weights.sum(), likelihoods, (f.gain for f in fits))
    return sorted(found, key=lambda candidate: -candidate.probability)


def _fit(plan: PatternPlan, readings: NDArray[Any]) -> Fit:
    """Log-likelihoods of readings (frames, M) under a plan, the mean over some frames."""
    frames = np.unique(np.linspace(0, len(readings) - 1, MAX_FRAMES).astype(int))
    fits = [_fit_frame(plan, readings[frame].astype(np.float64)) for frame in frames]
    return Fit(*np.mean(fits, axis=0))


class _Parts(NamedTuple):
    """Readings M as ``rows`` and their coefficients ``values``, both (K,), and ``sums`` in which
    rows cancel, less their median; ``level`` is the coefficient of the level, nan if it has none."""

    rows: NDArray[np.int32]
    values: Floats
    sums: Floats
    level: float


def _parts(plan: PatternPlan, readings: Floats) -> _Parts:
    both = _pairs(plan)
    if both is not None:
        plus, minus = both
        rows = plan.index[plus]
        sums = (readings[plus] + readings[minus]) / np.sqrt(2)
        values = (readings[plus] - readings[minus]) / np.sqrt(2)
        lit = rows == plan.patterns.level
        level = float(values[lit][0]) if lit.any() else np.nan
        return _Parts(rows[~lit], values[~lit], sums - np.median(sums), level)
    varying = plan.index != plan.patterns.level
    rows, values = plan.index[varying], readings[varying]
    if not plan.polarity.any():
        return _Parts(rows, values, np.empty(0), np.nan)
    expected = row_spectra(plan.shape).mean(axis=0)[rows]
    weak = expected <= np.median(expected)
    background = np.median(values[weak])
    level = readings[~varying] - background
    rows, values = rows, values - background
    if level.size == 2:  # all on and dark: half their sum is the background, but for noise
        rows = np.append(rows, rows[np.argmin(expected)])
        values = np.append(values, level.sum() / np.sqrt(2))
    return _Parts(rows, values, np.empty(0), float(level @ plan.polarity[~varying]))


def _pairs(plan: PatternPlan) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Positions of both polarities of every row, None unless each is shown just so."""
    plus, minus = (np.flatnonzero(plan.polarity == sign) for sign in (1, -1))
    if plus.size + minus.size < plan.exposures or plus.size != minus.size:
        return None
    plus, minus = (at[np.argsort(plan.index[at], kind="stable")] for at in (plus, minus))
    return (plus, minus) if (plan.index[plus] == plan.index[minus]).all() else None


def _fit_frame(plan: PatternPlan, readings: Floats) -> Fit:
    scale = float(np.abs(readings).max()) or 1.0
    rows, values, sums, level = _parts(plan, readings / scale)
    models = row_spectra(plan.shape)
    found = _fit_some(values, models, rows)
    others = readings.size - values.size - sums.size  # the level: anything goes
    penalty = -others * log(2.0)
    if plan.polarity.any():  # the background is one more parameter
        penalty -= log(readings.size) / 2 + NEGATIVE * (readings.min() < 0)
    if level < 0:  # all on is darker than all off
        penalty -= readings.size
    if sums.size:
        penalty += gaussian(sums)
    return Fit(found.image + penalty, found.white + penalty)


def _fit_some(values: Floats, models: Floats, rows: NDArray[np.int32]) -> Fit:
    """Fit of some of many values, for all."""
    every = np.unique(np.linspace(0, values.size - 1, MAX_FITTED).astype(int))
    share = values.size / every.size
    return Fit(*(share * each for each in fit(values[every], models[:, rows[every]])))


@lru_cache(maxsize=4)
def row_spectra(shape: tuple[int, int]) -> Floats:
    """Variances (models, N) of all Hadamard rows in images, 0 for the level."""
    basis = Hadamard(shape)
    operator = RowOperator(basis, np.arange(basis.rows, dtype=np.int32))
    found = np.zeros((len(some := spectra(operator)), basis.rows))
    found[:, operator.varying] = some
    return found
