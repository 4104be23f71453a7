"""Commands of `python -m reconstruction` that send and receive streams."""

from . import live, replay

__all__ = ["live", "replay"]
