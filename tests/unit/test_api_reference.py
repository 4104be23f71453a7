"""The reference of the Python interface, as the site is built with it, holds every public name."""

import re
from pathlib import Path

import pytest

from reference_pages import PYTHON, ROOT, namesakes, pages, public_names

SITE = ROOT / "out" / "site" / "reference"


def listed(page: str) -> list[str]:
    return re.findall(r"^::: (\S+)$", pages()[page], re.M)


def test_names_of_the_two_packages_are_on_the_page_of_python() -> None:
    names = public_names()
    assert sorted(listed("python.md")) == sorted(
        f"{root}.{name}" for root in PYTHON for name in names[root] if name != "__version__"
    )


@pytest.mark.parametrize("root", PYTHON)
def test_all_other_packages_are_on_the_page_of_their_root(root: str) -> None:
    """With every public name, as mkdocstrings is told to show."""
    options = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert "filters: public" in options
    assert "show_if_no_docstring: true" in options
    inside = {each for each in public_names() if each.startswith(f"{root}.")}
    assert len(inside) > 5
    assert inside | set(PYTHON[root]) <= set(listed(f"python-{root}.md"))


def test_packages_beside_the_simulator_are_there() -> None:
    folders = {"spisim_live": "live", "spisim_formats": "formats", "spisim_app": "app"}
    beside = [name for names in PYTHON.values() for name in names]
    assert {name.partition(".")[0] for name in beside} == set(folders)
    for name in beside:
        folder = ROOT.joinpath(folders[name.partition(".")[0]], *name.split("."))
        assert (folder / "__init__.py").is_file()


def test_lists_of_names_stand_in_init_alone() -> None:
    strange = [
        path
        for root in PYTHON
        for path in (ROOT / root).rglob("*.py")
        if path.name != "__init__.py" and "\n__all__" in path.read_text(encoding="utf-8")
    ]
    assert not strange


@pytest.mark.slow
def test_every_public_name_is_on_a_page_of_the_site() -> None:
    if not SITE.is_dir():
        pytest.skip("the site is not built: make docs")
    ids = {
        each
        for page in SITE.glob("python*.html")
        for each in re.findall(r'id="([^"]+)"', Path(page).read_text(encoding="utf-8"))
    }
    for package, names in public_names().items():
        resolved = {each.rpartition(".")[0] for each in namesakes(package, names)}
        expected = {f"{package}.{name}" for name in names if name != "__version__"} - resolved
        assert expected | set(namesakes(package, names)) <= ids
