"""How many files of other programs open, whether they are right, and how long a large world takes.

    python benchmarks/importing.py [--quick] [--json] [--markdown] [--suite NAME=FOLDER ...]

A suite is a folder of other people's files, such as a checkout of assimp or of PX4's models; none
is part of this repository. What trimesh reads, or for worlds and scenes the XML says, holds
triangles or not; triangles and bounds are compared with trimesh's. The large world, a terrain and
5000 models of 40 meshes, is made here. `--markdown` pastes the tables into docs/importing.md.
"""

import logging
import resource
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from options import benchmark_options, finish

from reconstruction.errors import InputError
from spisim.paper.checks import Check, Table, surroundings
from spisim.scene.importing import FORMATS
from spisim.scene.importing.files import Folders
from spisim.scene.importing.model import Content
from spisim.scene.importing.shapes import as_mesh
from spisim.transport.mitsuba_scene import read_mitsuba

PAGE = Path(__file__).parents[1] / "docs" / "importing.md"
READERS = {**FORMATS, ".xml": read_mitsuba}
#: Formats that trimesh reads, too, in the file's own unit and axes.
COMPARED = (".glb", ".gltf", ".obj", ".stl", ".ply", ".dae")
#: Bounds of equal files differ by so much of the scene's size at most.
TOLERANCE = 1e-3
OPENED, SECONDS = 0.95, 60.0
MODELS, QUICK_MODELS, MESHES = 5000, 300, 40


@dataclass
class Suite:
    """What became of the files of a folder."""

    name: str
    tried: int = 0
    empty: int = 0  # nothing in them, as others say
    opened: int = 0
    compared: int = 0
    different: list[str] = field(default_factory=list)
    refused: Counter[str] = field(default_factory=Counter)

    @property
    def share(self) -> float:
        """Opened, of those that hold triangles."""
        return self.opened / max(1, self.tried - self.empty)


def read_suite(name: str, folder: Path) -> Suite:
    """Try every file of a known format."""
    suite = Suite(name)
    files = [path for path in sorted(folder.rglob("*")) if path.suffix.lower() in READERS]
    for path in (path for path in files if path.is_file() and ".git" not in path.parts):
        independent = independent_mesh(path)
        suite.tried += 1
        try:
            folders = Folders.around(path, (folder,), skip_missing=True)
            content = READERS[path.suffix.lower()](path, folders)
            if not content.parts:
                raise InputError("holds no triangles")
        except InputError as error:
            if independent is None:
                suite.empty += 1
            else:
                suite.refused[reason(str(error), path)] += 1
            continue
        suite.opened += 1
        if isinstance(independent, trimesh.Trimesh):
            suite.compared += 1
            if not equal(content, independent):
                suite.different.append(path.name)
    return suite


def independent_mesh(path: Path) -> trimesh.Trimesh | bool | None:
    """All triangles as trimesh has them, True where an XML file tells of some, or None."""
    if path.suffix.lower() not in COMPARED:
        return holds_shapes(path) or None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = trimesh.load_scene(path, process=False, skip_materials=True).to_mesh()
            usable = len(mesh.faces) > 0 and np.isfinite(mesh.bounds).all() and mesh.area > 0
    except Exception:  # whatever trimesh runs into
        return None
    return mesh if usable else None


def holds_shapes(path: Path) -> bool:
    """Whether a world, robot, stage or scene shows anything by itself."""
    if path.suffix.lower().startswith(".usd"):
        return True
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, LookupError, ValueError, OSError):
        return False
    if root.tag == "scene":
        return root.find(".//shape") is not None
    shapes = root.iterfind(".//visual/geometry/*")
    return root.tag in ("sdf", "robot") and any(shape.tag != "empty" for shape in shapes)


def equal(content: Content, other: trimesh.Trimesh) -> bool:
    """Same number of triangles and same bounds."""
    placed = [as_mesh(p.geometry).copy().apply_transform(p.to_world) for p in content.parts]
    low = np.min([mesh.bounds[0] for mesh in placed], axis=0)
    high = np.max([mesh.bounds[1] for mesh in placed], axis=0)
    count = sum(len(mesh.faces) for mesh in placed)
    far = np.abs([low, high] - other.bounds).max()
    return count == len(other.faces) and bool(far <= TOLERANCE * other.extents.max())


def reason(message: str, path: Path) -> str:
    """The end of a message, without names."""
    plain = message.replace(str(path), "").split("; ")[0].split(": ")[-1]
    return " ".join("…" if "'" in word or "/" in word else word for word in plain.split())[:60]


def write_world(folder: Path, models: int) -> Path:
    """A terrain and copies of meshes, in SDFormat; about 200 triangles a model."""
    rng = np.random.default_rng(0)
    meshes = folder / "meshes"
    meshes.mkdir()
    side = np.linspace(-150, 150, 170)
    x, y = np.meshgrid(side, side)
    points = np.stack([x, y, 2 * np.sin(x / 30) * np.cos(y / 41)], axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(x.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    faces = np.concatenate([np.stack([a, b, d], axis=-1), np.stack([a, d, c], axis=-1)])
    trimesh.Trimesh(points, faces.reshape(-1, 3), process=False).export(meshes / "terrain.obj")
    kinds = (
        lambda k: trimesh.creation.cylinder(0.2 + 0.02 * k, 4, sections=48),
        lambda k: trimesh.creation.icosphere(2, 1 + 0.02 * k),
        lambda k: trimesh.creation.box((1 + 0.1 * k, 2, 3)).subdivide().subdivide(),
        lambda k: trimesh.creation.cone(1.5, 4, sections=60),
    )
    for k in range(MESHES):
        kinds[k % len(kinds)](k).export(meshes / f"thing{k}.obj")
    rows = [model("terrain", "terrain", np.zeros(4))]
    for j in range(models):
        px, py = rng.uniform(-145, 145, 2)
        height = 2 * np.sin(px / 30) * np.cos(py / 41)
        rows.append(model(f"tree_{j}", f"thing{j % MESHES}", [px, py, height, rng.uniform(0, 6)]))
    file = folder / "world.sdf"
    file.write_text(f"<sdf version='1.9'><world name='w'>{''.join(rows)}</world></sdf>")
    return file


def model(name: str, mesh: str, pose: np.ndarray | list[float]) -> str:
    """A static model at x, y, z and a yaw."""
    x, y, z, yaw = pose
    return (
        f"<model name='{name}'><static>true</static><pose>{x} {y} {z} 0 0 {yaw}</pose>"
        "<link name='l'><visual name='v'><geometry><mesh>"
        f"<uri>meshes/{mesh}.obj</uri></mesh></geometry></visual></link></model>"
    )


def seconds_of(*arguments: str | Path) -> float:
    """Processor time of a command of spisim, all threads together."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "spisim", *map(str, arguments)]
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def time_world(models: int) -> dict[str, float]:
    """Seconds of each command."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        world, scene = write_world(folder, models), folder / "world.yaml"
        return {
            "import": seconds_of("scenes", "import", world, "-o", scene),
            "scenes show": seconds_of("scenes", "show", scene, "-o", folder / "world.png"),
            "simulate": seconds_of("simulate", scene, "-o", folder / "world.h5"),
        }


def suite_table(suites: list[Suite]) -> Table:
    """One row for each suite."""
    rows = [
        (
            suite.name,
            str(suite.tried),
            str(suite.tried - suite.empty),
            f"{suite.opened} ({suite.share:.1%})",
            f"{suite.compared - len(suite.different)} of {suite.compared}",
            "; ".join(f"{count} {why}" for why, count in suite.refused.most_common(4)) or "–",
        )
        for suite in suites
    ]
    columns = ("suite", "tried", "hold triangles", "opened", "equal to trimesh's", "refused for")
    return Table("Files of others, and what became of them.", columns, rows)


def main() -> int:
    """Run it."""
    logging.disable(logging.ERROR)  # what trimesh and pycollada say of textures
    options = benchmark_options(
        __doc__,
        f"a world of {QUICK_MODELS} models",
        PAGE,
        {"--suite": "NAME=FOLDER of other people's files; repeatable"},
    )
    given = (text.partition("=") for text in options.suite)
    suites = [read_suite(name, Path(folder)) for name, _, folder in given]
    models = QUICK_MODELS if options.quick else MODELS
    times = time_world(models)
    total = sum(times.values())
    rows = [(name, f"{seconds:.1f}") for name, seconds in {**times, "together": total}.items()]
    tables = [Table(f"A world of {models} models: processor time.", ("command", "s"), rows)]
    checks = [Check("large world: import, show and simulate, s", total, SECONDS)]
    if suites:
        tables.insert(0, suite_table(suites))
    for suite in suites:
        checks.append(Check(f"{suite.name}: share opened", suite.share, OPENED, at_least=True))
        checks.append(Check(f"{suite.name}: unlike trimesh's", len(suite.different), 0))
        if suite.different:
            print(f"{suite.name}: unlike trimesh's: {suite.different}", file=sys.stderr)
    around = surroundings(["trimesh", "pycollada", "mitsuba", "usd-core", "DracoPy"])
    return finish(options, PAGE, "benchmark: importing", around, tables, checks)


if __name__ == "__main__":
    sys.exit(main())
