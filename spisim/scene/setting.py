"""Where the description of a scene comes from."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from reconstruction.base.errors import InputError
from spisim.scene.stock import Stock


@dataclass(frozen=True)
class Setting:
    """Where a description comes from, and the wavelength that its scene is made for.

    Pictures, tables and meshes lie in `folder`; `text` is what the scene says that it was made
    from, `source` what error messages call it; `stock` has what other scenes were made of.
    """

    folder: Path
    text: str
    source: Path | str
    wavelength_nm: float = 1550.0
    stock: Stock = field(default_factory=Stock)

    @contextmanager
    def problems_at(self, place: str) -> Iterator[None]:
        """Put file and field in front of an InputError's message."""
        try:
            yield
        except InputError as error:
            raise InputError(f"{self.source}: {place}: {error}") from None
