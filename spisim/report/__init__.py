"""Pages and pictures about captures, data sets, flights and studies."""

from .capture import write_report
from .overview import write_overview

__all__ = ["write_overview", "write_report"]
