"""What is known of a detector beside its readings, by name and in a small file."""

import re
from collections.abc import Mapping
from pathlib import Path

from ...base.errors import InputError, naming, nearest

ABOUT: dict[str, float] = {
    "electrons_per_count": float("nan"),
    "offset_counts": 0.0,
    "noise_electrons": float("nan"),
    "excess_noise_factor": 1.0,
    "dead_time_s": 0.0,
    "exposure_time_s": float("nan"),
    "pattern_period_s": float("nan"),
}
"""Fields of `Buckets` that a recording may come without, and their values where nothing is said."""

MAX_BYTES = 2**16
LINE = re.compile(r"\s*(\w+)\s*:\s*([^#]*?)\s*(#.*)?")


def checked_about(
    values: Mapping[str, float], names: Mapping[str, float] = ABOUT
) -> dict[str, float]:
    """All ``names``, with these values; InputError for unknown ones."""
    for name in values:
        if name not in names:
            raise InputError(f"unknown {name!r} of a recording: {nearest(name, names)}")
    return {**names, **values}


def read_about(path: Path, names: Mapping[str, float] = ABOUT) -> dict[str, float]:
    """Values of a YAML file of lines ``name: number``, of these ``names``.

    Raises InputError for anything else.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with naming(path):
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"has more than {MAX_BYTES // 2**10} KiB; a few lines are expected")
        lines = path.read_text("utf-8-sig", "replace").splitlines()
        result = dict(_read_line(line) for line in lines if line.partition("#")[0].strip())
        checked_about(result, names)
        return result


def _read_line(line: str) -> tuple[str, float]:
    match = LINE.fullmatch(line)
    if match is None:
        raise InputError(f"{line.strip()[:60]!r} is not of the form name: number")
    try:
        return match[1], float(match[2])
    except ValueError:
        raise InputError(f"{match[1]} is {match[2][:40]!r}, must be a number") from None
