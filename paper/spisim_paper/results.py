"""The paper's results, computed and compared with the paper.

"Evaluation of a 3D imaging vision system based on a single-pixel InGaAs detector and the
Time-of-Flight principle for drones": Figure 2 (maximum range of the single pixel), Table 2 (time
per image) and Figure 3 (maximum range of ranging).
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from spisim_paper.checks import Result
from spisim_paper.fig2 import figure_2
from spisim_paper.fig3 import figure_3
from spisim_paper.table2 import table_2

#: Functions that compute the results, in the order of the paper.
RESULTS: Mapping[str, Callable[[], Result]] = MappingProxyType(
    {"fig2": figure_2, "table2": table_2, "fig3": figure_3}
)

__all__ = ["RESULTS"]
