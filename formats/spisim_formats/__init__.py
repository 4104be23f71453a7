"""Import scenes of other programs and export to them: one folder per format.

`spisim_formats.library` has what formats share on the way from a file's parts and materials to a
scene file. Formats of other packages are entry points of the group `spisim.scene_formats`, each a
`SceneFormat`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spisim_formats.exporting import export_scene
    from spisim_formats.format import SCENE_FORMATS, SceneFormat
    from spisim_formats.importing import Import, Options, import_scene

__all__ = ["SCENE_FORMATS", "Import", "Options", "SceneFormat", "export_scene", "import_scene"]

_HOMES = {"SCENE_FORMATS": "format", "SceneFormat": "format", "export_scene": "exporting"}


def __getattr__(name: str) -> Any:
    """Import on first use, because the command line lists commands before it needs any."""
    if name not in __all__:
        raise AttributeError(f"module 'spisim_formats' has no attribute {name!r}")
    return getattr(import_module(f"spisim_formats.{_HOMES.get(name, 'importing')}"), name)


def __dir__() -> list[str]:
    """The public names, imported or not."""
    return sorted(__all__)
