"""Weather sections of scene files: media in all the air, or falling drops."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar, Literal

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.precipitation import Precipitation
from spisim.base.config import Positive, Section, Vector


class Weather(Section, ABC):
    """A section of a scene file."""

    @abstractmethod
    def made(self, folder: Path, wavelength_nm: float) -> Atmosphere | Precipitation:
        """The medium or drops described, at a wavelength; files are relative to `folder`."""


class Falling(Weather):
    """Rain or snow; fields in `of_medium` and `of_drops` go with one model only."""

    of_medium: ClassVar[frozenset[str]]
    of_drops: ClassVar[frozenset[str]] = frozenset({"wind_m_s"})
    rate_mm_per_h: Positive
    """Rate, as water."""
    model: Literal["medium", "drops"] = "medium"
    """A smooth medium, or single drops that cross the beams."""
    wind_m_s: Vector = (0.0, 0.0, 0.0)
    """Wind that drops drift with; goes with `drops`."""

    @model_validator(mode="after")
    def _fields_of_its_model(self) -> Falling:
        others = self.of_medium if self.model == "drops" else self.of_drops
        if stray := sorted(self.model_fields_set & others):
            raise PydanticCustomError(
                "falling",
                "{field} does not go with model {model}",
                {"field": stray[0], "model": self.model},
            )
        return self
