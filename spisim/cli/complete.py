"""What a shell may put in place of the beginning of a word: each in a fraction of a second."""

from pathlib import Path


def scenes(incomplete: str) -> list[str]:
    """Shipped scenes, and scene files."""
    from spisim.base.config import shipped

    return _of(shipped("scenes"), incomplete)


def studies(incomplete: str) -> list[str]:
    """Shipped studies, and files of studies."""
    from spisim.base.config import shipped

    return _of(shipped("studies"), incomplete)


def instruments(incomplete: str) -> list[str]:
    """Presets, and files of instruments."""
    return _of(Path(__file__).parents[1] / "instrument" / "presets", incomplete)


def materials(incomplete: str) -> list[str]:
    """Shipped materials."""
    from spisim.scene.materials import shipped_materials

    return [name for name in shipped_materials().names if name.startswith(incomplete)]


def _of(folder: Path, incomplete: str) -> list[str]:
    """Names of the YAML files in a folder, and YAML files and folders of the user."""
    names = sorted(path.stem for path in folder.glob("*.yaml") if path.stem.startswith(incomplete))
    head, slash, tail = incomplete.rpartition("/")
    position = Path(head + slash or ".")
    mine = sorted(
        f"{head}{slash}{path.name}{'/' if path.is_dir() else ''}"
        for path in (position.iterdir() if position.is_dir() else ())
        if path.name.startswith(tail) and (path.is_dir() or path.suffix in (".yaml", ".yml"))
    )
    return names + [name for name in mine if not name.rpartition("/")[2].startswith(".")]
