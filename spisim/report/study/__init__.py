"""What a study found, as a page with its plots."""

from pathlib import Path

from reconstruction.files import write_atomically
from spisim.report.study.page import write_report
from spisim.report.study.plots import study_plots
from spisim.report.study.profile_plot import profile_plot
from spisim.study import Results

__all__ = ["write_study"]


def write_study(folder: Path, results: Results) -> tuple[Path, ...]:
    """Write report.html and, beside it, its plots; the files, that one first.

    Plots of an earlier run that are none of this one's are removed.
    """
    plots = study_plots(results)
    if results.planned.study.x == "scene":
        plots.append(profile_plot(results))
    pictures = []
    for plot in plots:
        for suffix, content in (("png", plot.png), ("svg", plot.svg)):
            pictures.append(folder / "plots" / f"{plot.name}.{suffix}")
            write_atomically(pictures[-1], content)
    for path in set((folder / "plots").iterdir()) - set(pictures):  # of other metrics, earlier
        path.unlink()
    report = folder / "report.html"
    write_report(report, results, plots)
    return (report, *pictures)
