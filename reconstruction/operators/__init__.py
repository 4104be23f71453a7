"""Pattern plans, and the linear operators that relate their readings to images."""

from .bases import BASES, basis_of
from .basis import Basis, checked_shape
from .decoder import Decoder, decoder_for
from .hadamard import fwht, sequency
from .operator import MatrixOperator, MeasurementOperator, RowOperator, SeenAtoms
from .orders import ORDERS, pattern_order
from .outliers import OutlierDetector
from .plan import (
    NO_PATTERN,
    PatternPlan,
    expose,
    illumination,
    interleaved,
    make_plan,
    mean_illumination,
    ordered_rows,
    plan_of_rows,
    transposed,
)
from .polarities import POLARITIES
from .redundancy import Drift, drift_of, redundant_combinations
from .sparse import SparseRows
from .throughput import Throughput
from .unequal import with_throughput

__all__ = [
    "BASES",
    "NO_PATTERN",
    "ORDERS",
    "POLARITIES",
    "Basis",
    "Decoder",
    "Drift",
    "MatrixOperator",
    "MeasurementOperator",
    "OutlierDetector",
    "PatternPlan",
    "RowOperator",
    "SeenAtoms",
    "SparseRows",
    "Throughput",
    "basis_of",
    "checked_shape",
    "decoder_for",
    "drift_of",
    "expose",
    "fwht",
    "illumination",
    "interleaved",
    "make_plan",
    "mean_illumination",
    "ordered_rows",
    "pattern_order",
    "plan_of_rows",
    "redundant_combinations",
    "sequency",
    "transposed",
    "with_throughput",
]
