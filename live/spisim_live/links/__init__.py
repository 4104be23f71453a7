"""Links that carry the bytes of a stream, by their addresses."""

from .addresses import is_link, outlet_to, source_at
from .files import NewFile
from .link import Ended, Link, Outlet, Source

__all__ = ["Ended", "Link", "NewFile", "Outlet", "Source", "is_link", "outlet_to", "source_at"]
