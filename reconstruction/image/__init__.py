"""From coefficients to images: methods, dictionaries and priors."""

from .coefficients import CoefficientDecoder, Coefficients, without_shared_errors
from .dictionaries import DICTIONARIES
from .dictionary import Band, Dictionary, StrongestAtoms
from .imaging import Imaging, UsableReadings
from .method import CarryingMethod, Estimate, ImageMethod, ImageSolver, Motion, SolverOfMany
from .methods import IMAGE_METHODS, image_method
from .omp import batch_omp, load_pursuit
from .prior import Prior, fit_variance
from .recognition import (
    WITHOUT_DARK,
    Candidate,
    Layout,
    candidate_layouts,
    dark_estimate,
    plan_inconsistency,
    recognise,
)

__all__ = [
    "DICTIONARIES",
    "IMAGE_METHODS",
    "WITHOUT_DARK",
    "Band",
    "Candidate",
    "CarryingMethod",
    "CoefficientDecoder",
    "Coefficients",
    "Dictionary",
    "Estimate",
    "ImageMethod",
    "ImageSolver",
    "Imaging",
    "Layout",
    "Motion",
    "Prior",
    "SolverOfMany",
    "StrongestAtoms",
    "UsableReadings",
    "batch_omp",
    "candidate_layouts",
    "dark_estimate",
    "fit_variance",
    "image_method",
    "load_pursuit",
    "plan_inconsistency",
    "recognise",
    "without_shared_errors",
]
