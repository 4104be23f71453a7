"""Studies: a data set swept over some parameters, reconstructed, evaluated, compared, and shown."""

from spisim.study.metrics import QUANTITIES
from spisim.study.plan import Study, StudyPlan, load_study
from spisim.study.results import Results
from spisim.study.run import run_study

__all__ = ["QUANTITIES", "Results", "Study", "StudyPlan", "load_study", "run_study"]
