"""The pictures and tables of docs/reference/scene-gallery.md.

    python tools/scene_gallery.py [DOCS]

Draws a thumbnail of every shipped scene, and of some draws of every family, into DOCS/images/scenes
(by default of this checkout) and writes the tables between the marks of the page.
"""

import argparse
import io
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from reconstruction.base.files import write_atomically
from spisim.instrument import Instrument, load_instrument
from spisim.scene import Scene, catalogue, draw_scene, load_scene
from spisim.scene.families import FAMILIES
from spisim.transport import RayCaster
from spisim_app.report.scene_view import Look, Survey, survey
from spisim_app.report.scene_view.picture import PROJECTOR, look_figure, view_image
from spisim_paper.checks import Table, around_marks

DOCS = Path(__file__).parents[1] / "docs"
PIXELS = 200
#: Of the thumbnails; the projector's field is drawn in.
FOV_DEG = 40.0
SEEDS = range(4)
QUALITY = 82


def main(docs: Path) -> None:
    """Draw everything anew."""
    instrument = load_instrument("paper")
    pictures = docs / "images" / "scenes"
    tables = {
        "library": _table(_library(pictures, instrument)),
        "families": _table(_families(pictures, instrument)),
    }
    _show(load_scene("warehouse"), instrument, pictures / "show.jpg")
    page = docs / "reference" / "scene-gallery.md"
    for name, table in tables.items():
        before, after = around_marks(page, name)
        write_atomically(page, f"{before}\n\n{table}\n{after}".encode())


def _show(scene: Scene, instrument: Instrument, path: Path) -> None:
    """What `spisim scenes show` draws, in little room."""
    caster = RayCaster.of(scene)
    look = Look(scene, instrument, caster, survey(scene, instrument, caster))
    buffer = io.BytesIO()
    look_figure(look).savefig(buffer, format="jpeg", dpi=72, pil_kwargs={"quality": QUALITY})
    write_atomically(path, buffer.getvalue())


def _table(rows: Iterator[tuple[str, ...]]) -> str:
    """Rows of Markdown; the first one is the columns."""
    columns, *others = rows
    return Table("", columns, others).markdown().lstrip("\n")


def _library(pictures: Path, instrument: Instrument) -> Iterator[tuple[str, ...]]:
    yield "", "scene", "air", "nearest, m", "spots, m", "objects", "triangles"
    for entry in catalogue():
        print(entry.name, file=sys.stderr)
        picture, result = _thumbnail(load_scene(entry.name), instrument, pictures / entry.name)
        yield (
            picture,
            f"**{entry.name}**: {entry.description}",
            ", ".join(entry.weather) or "clear",
            f"{result.nearest.range_m:.1f}",
            ", ".join(f"{spot.range_m:.1f}" for spot in result.spots),
            str(result.objects),
            f"{result.triangles:,}",
        )


def _families(pictures: Path, instrument: Instrument) -> Iterator[tuple[str, ...]]:
    yield ("family", *(f"seed {seed}" for seed in SEEDS))
    for name, family in FAMILIES.items():
        print(name, file=sys.stderr)
        drawn = [
            _thumbnail(draw_scene(name, seed), instrument, pictures / f"{name}-{seed}")[0]
            for seed in SEEDS
        ]
        yield (f"**{name}**: {family.description}", *drawn)


def _thumbnail(scene: Scene, instrument: Instrument, path: Path) -> tuple[str, Survey]:
    """Write PATH.jpg; its Markdown, and what there is in the scene."""
    caster = RayCaster.of(scene)
    colours = view_image(scene, caster, FOV_DEG, PIXELS)
    image = Image.fromarray(np.round(255 * colours).astype(np.uint8))
    half = PIXELS / 2 / np.tan(np.radians(FOV_DEG / 2))
    wide = half * instrument.imaging.projector.tan_half_width
    high = half * instrument.imaging.projector.tan_half_height
    middle = PIXELS / 2
    corners = middle - wide, middle - high, middle + wide, middle + high
    ImageDraw.Draw(image).rectangle(corners, outline=PROJECTOR)
    buffer = io.BytesIO()
    image.save(buffer, "jpeg", quality=QUALITY, optimize=True)
    file = path.with_name(f"{path.name}.jpg")
    write_atomically(file, buffer.getvalue())
    return f"![{path.name}](../images/scenes/{file.name})", survey(scene, instrument, caster)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("docs", nargs="?", type=Path, default=DOCS, help="folder of the pages")
    main(parser.parse_args().docs)
