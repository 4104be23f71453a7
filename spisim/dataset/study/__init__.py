"""Studies: vary parameters of a data set, reconstruct, evaluate, compare, and plot."""

from spisim.dataset.study.metrics import QUANTITIES
from spisim.dataset.study.plan import load_study
from spisim.dataset.study.run import run_study, study_files

__all__ = ["QUANTITIES", "load_study", "run_study", "study_files"]
