"""Instrument files and shipped presets."""

from pathlib import Path

from spisim.base.config import find_named, parse_model, read_text
from spisim.instrument.model import Instrument

PRESETS = Path(__file__).with_name("presets")
DETECTOR_PARTS = Path(__file__).with_name("detector_parts.yaml")


def list_presets() -> list[str]:
    """Names of the shipped instruments."""
    return sorted(path.stem for path in PRESETS.glob("*.yaml"))


def load_instrument(name_or_path: str | Path) -> Instrument:
    """Instrument from a YAML file, or a shipped one by its name ("paper").

    Raises InputError, naming file, field, value and what is allowed, for a file or preset that is
    missing, YAML that does not parse, and fields that are unknown, missing or out of range.
    """
    file = find_named(str(name_or_path), PRESETS, "instrument")
    return parse_model(read_text(file), Instrument, file, file.parent)
