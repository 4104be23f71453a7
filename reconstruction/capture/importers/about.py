"""Detector properties by name, and in a small file."""

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
"""Fields of `Buckets` that a recording may lack, and their defaults."""

MAX_BYTES = 2**16
LINE = re.compile(r"\s*(\w+)\s*:\s*([^#]*?)\s*(#.*)?")


def checked_about(
    values: Mapping[str, float], names: Mapping[str, float] = ABOUT
) -> dict[str, float]:
    """Complete values with the defaults ``names``; raises InputError for unknown names."""
    for name in values:
        if name not in names:
            raise InputError(f"unknown detector property {name!r}: {nearest(name, names)}")
    return {**names, **values}


def read_about(path: Path, names: Mapping[str, float] = ABOUT) -> dict[str, float]:
    """Read a YAML file of lines ``name: number``; ``names`` are those allowed and their defaults.

    Raises InputError if the file is missing, malformed or holds another name.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with naming(path):
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"has more than {MAX_BYTES // 2**10} KiB; expected a few lines")
        lines = path.read_text("utf-8-sig", "replace").splitlines()
        values = dict(_read_line(line) for line in lines if line.partition("#")[0].strip())
        checked_about(values, names)
        return values


def _read_line(line: str) -> tuple[str, float]:
    match = LINE.fullmatch(line)
    if match is None:
        raise InputError(f"{line.strip()[:60]!r} is not of the form name: number")
    try:
        return match[1], float(match[2])
    except ValueError:
        raise InputError(f"{match[1]} is {match[2][:40]!r}, must be a number") from None
