"""Plans with the axes of their patterns exchanged."""

import numpy as np

from ..base.errors import InputError
from .bases.dense import Dense
from .bases.hadamard import Hadamard
from .plan import PatternPlan


def transposed(plan: PatternPlan) -> PatternPlan:
    """The plan whose patterns are those of another with rows and columns exchanged.

    A plan of W x H pixels that are numbered row by row becomes one of H x W pixels, numbered column
    by column as MATLAB does. InputError for other than Hadamard and dense patterns.
    """
    height, width = plan.shape
    if isinstance(plan.patterns, Hadamard):
        down, along = np.divmod(plan.index, width)
        index = along * height + down
        return PatternPlan((width, height), index, plan.polarity, plan.order)
    if isinstance(plan.patterns, Dense):
        basis = Dense(plan.patterns.patterns.transpose(0, 2, 1))
        return PatternPlan(basis.shape, plan.index, plan.polarity, plan.order, basis)
    raise InputError(f"patterns of the basis {plan.basis!r} cannot be transposed")
