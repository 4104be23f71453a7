"""Where the description of a scene comes from."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from reconstruction.base.errors import InputError
from spisim.scene.cache import SceneCache


@dataclass(frozen=True)
class LoadContext:
    """Where a description comes from, and the wavelength that its scene is made for.

    Pictures, tables and meshes lie in `folder`; `text` is what the scene says that it was made
    from, `source` what error messages call it; `cache` has what other scenes were made of.
    """

    folder: Path
    text: str
    source: Path | str
    wavelength_nm: float = 1550.0
    cache: SceneCache = field(default_factory=SceneCache)

    @contextmanager
    def problems_at(self, location: str) -> Iterator[None]:
        """Put file and field in front of an InputError's message."""
        try:
            yield
        except InputError as error:
            raise InputError(f"{self.source}: {location}: {error}") from None
