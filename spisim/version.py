"""Version of the simulator, as its captures tell it."""

__version__ = "0.1.0"
