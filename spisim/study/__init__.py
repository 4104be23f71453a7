"""Studies: a data set swept over some parameters, reconstructed, evaluated, compared, and shown."""

from spisim.study.metrics import METRICS
from spisim.study.plan import Study, StudyPlan, load_study
from spisim.study.results import Results
from spisim.study.run import run_study

__all__ = ["METRICS", "Results", "Study", "StudyPlan", "load_study", "run_study"]
