"""Hook of the build: scene files and meshes go into the wheel, without the worlds beside them."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class WheelScenes(BuildHookInterface):
    """Adds what lies in `scenes`, but for packages."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Extend what the wheel includes."""
        for path in sorted((Path(self.root) / "scenes").iterdir()):
            if not (path / "__init__.py").is_file() and path.name != "__pycache__":
                build_data["force_include"][str(path)] = f"spisim/shipped/scenes/{path.name}"
