"""Installed packages that add something by entry points, without an installation."""

from collections.abc import Mapping
from pathlib import Path


def install(
    folder: Path, name: str, entries: Mapping[str, Mapping[str, str]], source: str = ""
) -> None:
    """A distribution ``name`` with one module of that name, and entry points by group and name."""
    (folder / f"{name}.py").write_text(source, encoding="utf-8")
    reported = folder / f"{name}-1.0.dist-info"
    reported.mkdir()
    (reported / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = []
    for group, points in entries.items():
        lines += [f"[{group}]", *(f"{entry} = {value}" for entry, value in points.items())]
    (reported / "entry_points.txt").write_text("\n".join(lines) + "\n")
