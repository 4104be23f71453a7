"""Fast shell completion."""

from pathlib import Path

import spisim


def scenes(incomplete: str) -> list[str]:
    """Complete shipped scenes, and scene files."""
    from spisim.base.config import shipped

    return _of(shipped("scenes"), incomplete)


def studies(incomplete: str) -> list[str]:
    """Complete shipped studies, and study files."""
    from spisim.base.config import shipped

    return _of(shipped("studies"), incomplete)


def instruments(incomplete: str) -> list[str]:
    """Complete presets, and instrument files."""
    return _of(Path(spisim.__file__).parent / "instrument" / "presets", incomplete)


def materials(incomplete: str) -> list[str]:
    """Complete shipped materials."""
    from spisim.scene.materials import shipped_materials

    return [name for name in shipped_materials().names if name.startswith(incomplete)]


def _of(folder: Path, incomplete: str) -> list[str]:
    """Return names of the YAML files in a folder, and YAML files and folders of the user."""
    names = sorted(path.stem for path in folder.glob("*.yaml") if path.stem.startswith(incomplete))
    head, slash, tail = incomplete.rpartition("/")
    base = Path(head + slash or ".")
    mine = sorted(
        f"{head}{slash}{path.name}{'/' if path.is_dir() else ''}"
        for path in (base.iterdir() if base.is_dir() else ())
        if path.name.startswith(tail) and (path.is_dir() or path.suffix in (".yaml", ".yml"))
    )
    return names + [name for name in mine if not name.rpartition("/")[2].startswith(".")]
