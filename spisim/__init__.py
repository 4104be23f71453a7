"""Simulator of a drone's single-pixel camera: a scene and an instrument become a capture.

import spisim

scene = spisim.load_scene("warehouse")
instrument = spisim.load_instrument("paper")
capture = spisim.simulate(scene, instrument, seed=0).capture
"""

import logging
from importlib import import_module
from typing import TYPE_CHECKING, Any

from spisim.base.llvm import prefer_working_llvm
from spisim.base.optional import import_app
from spisim.version import __version__

if TYPE_CHECKING:
    from spisim.base.progress import progress_bar
    from spisim.dataset.making import make_dataset
    from spisim.dataset.reader import open_dataset
    from spisim.instrument import Instrument, load_instrument
    from spisim.scene import Scene, load_scene
    from spisim.simulation import Simulation, simulate
    from spisim_app.report.capture import write_report

logging.getLogger(__name__).addHandler(logging.NullHandler())
prefer_working_llvm()  # now: whoever imports spisim may import Dr.Jit or Mitsuba next

__all__ = [
    "Instrument",
    "Scene",
    "Simulation",
    "__version__",
    "load_instrument",
    "load_scene",
    "make_dataset",
    "open_dataset",
    "progress_bar",
    "simulate",
    "write_report",
]

_MODULES = {
    "Instrument": "instrument",
    "Scene": "scene",
    "Simulation": "simulation",
    "load_instrument": "instrument",
    "load_scene": "scene",
    "make_dataset": "dataset.making",
    "open_dataset": "dataset.reader",
    "progress_bar": "base.progress",
    "simulate": "simulation",
}


def __getattr__(name: str) -> Any:
    """Import on first use: Mitsuba and Matplotlib are slow to load and often not needed."""
    if name == "write_report":
        return import_app("report.capture").write_report
    if name not in _MODULES:
        raise AttributeError(f"module 'spisim' has no attribute {name!r}")
    return getattr(import_module(f"spisim.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """The public names, imported or not."""
    return sorted(__all__)
