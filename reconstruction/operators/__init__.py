"""What was shown, and what its readings say of an image: pattern plans and linear operators."""

from .bases import BASES
from .basis import Basis, checked_shape
from .decoder import Decoder, decoder_for
from .hadamard import fwht, sequency
from .interleaving import interleaved
from .operator import MatrixOperator, MeasurementOperator, RowOperator, SeenAtoms
from .orders import ORDERS
from .plan import (
    POLARITIES,
    PatternPlan,
    expose,
    illumination,
    make_plan,
    mean_illumination,
    ordered_rows,
)
from .redundancy import redundant_combinations

__all__ = [
    "BASES",
    "ORDERS",
    "POLARITIES",
    "Basis",
    "Decoder",
    "MatrixOperator",
    "MeasurementOperator",
    "PatternPlan",
    "RowOperator",
    "SeenAtoms",
    "checked_shape",
    "decoder_for",
    "expose",
    "fwht",
    "illumination",
    "interleaved",
    "make_plan",
    "mean_illumination",
    "ordered_rows",
    "redundant_combinations",
    "sequency",
]
