"""From coefficients to an image: methods, dictionaries, priors."""

from .atoms import StrongestAtoms
from .coefficients import CoefficientDecoder, Coefficients
from .dictionaries import DICTIONARIES
from .dictionary import Band, Dictionary
from .imaging import Imaging, UsableReadings
from .method import CarryingMethod, Estimate, ImageMethod, ImageSolver, SolverOfMany
from .methods import IMAGE_METHODS, image_method
from .omp import batch_omp, load_pursuit
from .prior import Prior, fit_variance
from .recognition import (
    UNLIT,
    Candidate,
    Layout,
    candidate_layouts,
    dark_estimate,
    doubt,
    recognise,
)
from .shared_errors import without_shared_errors

__all__ = [
    "DICTIONARIES",
    "IMAGE_METHODS",
    "UNLIT",
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
    "Prior",
    "SolverOfMany",
    "StrongestAtoms",
    "UsableReadings",
    "batch_omp",
    "candidate_layouts",
    "dark_estimate",
    "doubt",
    "fit_variance",
    "image_method",
    "load_pursuit",
    "recognise",
    "without_shared_errors",
]
