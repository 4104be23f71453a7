"""The reference of the Python interface holds every public name."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "docs" / "reference"
SITE = ROOT / "out" / "site" / "reference"
PAGES = {"reconstruction": "python-reconstruction.md", "spisim": "python-simulator.md"}
BESIDE = {"spisim_formats": ROOT / "formats"}
"""Packages that are listed on the simulator's page as a whole, and the folders that hold them."""


def public_names() -> dict[str, list[str]]:
    """Names of each `__all__`, by package."""
    result = {}
    for root in PAGES:
        for path in sorted((ROOT / root).rglob("*.py")):
            for statement in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(statement, ast.Assign) and "__all__" in ast.unparse(statement):
                    assert path.name == "__init__.py", path
                    package = ".".join(path.parent.relative_to(ROOT).parts)
                    result[package] = ast.literal_eval(statement.value)
    return result


def test_names_of_the_two_packages_are_on_the_page_of_python() -> None:
    page = (REFERENCE / "python.md").read_text(encoding="utf-8")
    listed = re.findall(r"^::: (\S+)$", page, re.M)
    names = public_names()
    assert set(listed) == {
        f"{root}.{name}" for root in PAGES for name in names[root] if name != "__version__"
    }


def namesakes(package: str, names: list[str]) -> list[str]:
    """What has the name of its module, which mkdocstrings shows in its place: told one by one."""
    folder = ROOT.joinpath(*package.split("."))
    return [f"{package}.{name}.{name}" for name in names if (folder / f"{name}.py").is_file()]


def test_all_other_packages_are_on_the_page_of_their_root() -> None:
    """With every public name, as mkdocstrings is told to show."""
    options = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert "filters: public" in options
    assert "show_if_no_docstring: true" in options
    for root, page in PAGES.items():
        text = (REFERENCE / page).read_text(encoding="utf-8")
        listed = re.findall(r"^::: (\S+)$", text, re.M)
        inside = {each: names for each, names in public_names().items() if each != root}
        listed = [each for each in listed if each not in BESIDE]
        expected = [
            line
            for each, names in inside.items()
            if each.startswith(f"{root}.")
            for line in (each, *namesakes(each, names))
        ]
        assert sorted(listed) == sorted(expected)


def test_packages_beside_the_simulator_are_on_its_page() -> None:
    listed = (REFERENCE / PAGES["spisim"]).read_text(encoding="utf-8")
    for name, folder in BESIDE.items():
        assert (folder / name / "__init__.py").is_file()
        assert f"::: {name}\n" in listed


@pytest.mark.slow
def test_every_public_name_is_on_a_page_of_the_site() -> None:
    if not SITE.is_dir():
        pytest.skip("the site is not built: make docs")
    ids = {
        each
        for page in SITE.glob("python*.html")
        for each in re.findall(r'id="([^"]+)"', page.read_text(encoding="utf-8"))
    }
    for package, names in public_names().items():
        resolved = {each.rpartition(".")[0] for each in namesakes(package, names)}
        expected = {f"{package}.{name}" for name in names if name != "__version__"} - resolved
        assert expected | set(namesakes(package, names)) <= ids
