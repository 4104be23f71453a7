"""What `make docs` adds to the pages: reference, notebooks, promises, files from outside `docs`.

MkDocs calls these functions by their names, see its manual, "Hooks".
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.structure.files import File, Files
from nbconvert import MarkdownExporter

import reference_pages

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"

#: Tables of benchmarks within a page, by the comments around them.
MEASURED = re.compile(r"<!-- ([\w: -]+) -->\n(.*?)<!-- /\1 -->", re.S)
PROMISED = re.compile(r"What is promised:\n\n((?:\|.*\n)+)")
UPWARDS = re.compile(r"\]\((\.\./[\w./-]+)\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the reference, the notebooks as pages, and files that pages link to."""
    for name, text in reference_pages.pages().items():
        files.append(File.generated(config, f"reference/{name}", content=text))
    for notebook in sorted((DOCS / "tutorials").glob("*.ipynb")):
        for made in _rendered(notebook, config):
            files.append(made)
    linked = {
        outside
        for page in DOCS.rglob("*.md")
        for link in UPWARDS.findall(page.read_text(encoding="utf-8"))
        if (outside := _outside(page, link))
    }
    for target in sorted(linked):
        files.append(File.generated(config, f"files/{target}", abs_src_path=str(ROOT / target)))
    return files


def _outside(page: Path, link: str) -> str | None:
    """What a link from a page leads to, from the root of the repository, if that is no page."""
    target = (page.parent / link).resolve()
    return None if target.is_relative_to(DOCS) else str(target.relative_to(ROOT))


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Fill in what is gathered from the program and from other pages."""
    file = DOCS / page.file.src_uri
    up = "../" * page.file.src_uri.count("/")

    def along(link: re.Match[str]) -> str:
        outside = _outside(file, link[1])
        return f"]({up}files/{outside})" if outside else link[0]

    markdown = UPWARDS.sub(along, markdown)
    location = "<!-- benchmarks are put here -->"
    if location in markdown:
        markdown = markdown.replace(location, "\n".join(_benchmarks()))
    return markdown


def _rendered(notebook: Path, config: Any) -> Iterator[File]:
    """Page and pictures of a notebook with its outputs."""
    content = nbformat.read(notebook, as_version=4)
    exporter = MarkdownExporter(exclude_input_prompt=True, exclude_output_prompt=True)
    name = notebook.stem
    text, resources = exporter.from_notebook_node(
        content, {"unique_key": name, "output_files_dir": f"{name}-pictures"}
    )
    note = f"*This page is a notebook: [{notebook.name}]({notebook.name}).*\n"
    title, _, rest = text.lstrip().partition("\n")
    yield File.generated(config, f"tutorials/{name}.md", content=f"{title}\n\n{note}\n{rest}")
    for path, picture in resources.get("outputs", {}).items():
        yield File.generated(config, f"tutorials/{path}", content=picture)


def _benchmarks() -> Iterator[str]:
    """What every benchmark promises and has measured, from the pages that have its tables."""
    for page in sorted((DOCS / "results").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        for mark, block in MEASURED.findall(text):
            for table in PROMISED.findall(block):
                title = text.partition("\n")[0].removeprefix("# Results: ")
                measured = re.search(r"Measured on .*", block)
                yield f"\n## {title.capitalize()}: {mark.removeprefix('benchmark: ')}\n"
                yield f"From [{page.name}]({page.name}). {measured[0] if measured else ''}\n"
                yield table
