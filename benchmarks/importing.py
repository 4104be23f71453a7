"""How many files of other programs open, whether they are right, and how long a large world takes.

    python benchmarks/importing.py [--quick] [--json] [--markdown] [--suite NAME=FOLDER ...]

A suite is a folder of other people's files, such as a checkout of assimp or of PX4's models; none
is part of this repository. What trimesh reads, or for worlds and scenes the XML says, holds
triangles or not: shapes, and meshes whose files are in the suite. Parts of Mitsuba's scenes that
others include are tried with those alone. Triangles, their areas and where they are in the world
are compared with trimesh's, places of visuals in SDFormat with a plain walk through links and
models. The large world, a terrain and 5000 models of 40 meshes, is made here. `--markdown` pastes
the tables into docs/results/importing.md.
"""

import logging
import re
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from options import benchmark_options, finish

from reconstruction.base.errors import InputError
from spisim.scene import load_scene
from spisim.scene.pose import pose_matrix
from spisim_formats.format import readers
from spisim_formats.library.content import Content
from spisim_formats.library.drone import Surroundings, propose
from spisim_formats.library.files import Folders
from spisim_formats.library.shapes import as_mesh
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "importing.md"
READERS = readers()
#: Formats that trimesh reads, too, in the file's own unit and axes.
COMPARED = (".glb", ".gltf", ".obj", ".stl", ".ply", ".off", ".dae")
#: Weights of glTF's morphs, which trimesh leaves out.
MORPHED = re.compile(rb'"weights"\s*:')
#: Bounds of equal files differ by so much of the scene's size at most.
TOLERANCE = 1e-3
SUITE = {"action": "append", "default": [], "help": "NAME=FOLDER of other people's; repeatable"}
OPENED, SECONDS, SEARCH_SECONDS = 0.95, 60.0, 5.0
#: What an independent reader does not know: trimesh instances, the walk frames and includes.
BEYOND_TRIMESH = b"EXT_mesh_gpu_instancing"
BEYOND_WALK = ("include", "frame", "submesh")
FROM_FILES = ("mesh", "heightmap", "image", "polyline", "empty")
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
    def fraction(self) -> float:
        """Opened, of those that hold triangles."""
        return self.opened / max(1, self.tried - self.empty)


def read_suite(name: str, folder: Path) -> Suite:
    """Try every file of a known format."""
    suite = Suite(name)
    every = [
        path for path in sorted(folder.rglob("*")) if path.is_file() and ".git" not in path.parts
    ]
    there = {path.name for path in every if path.stat().st_size}
    included = included_files(every)
    models = {path.parents[1] for path in every if path.name in ("model.sdf", "model.config")}
    for path in (path for path in every if path.suffix.lower() in READERS):
        if path.name in included:
            continue
        independent = independent_mesh(path, there)
        suite.tried += 1
        try:
            folders = Folders.around(path, (folder, *sorted(models)))
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
        same = compare(path, content, independent)
        suite.compared += same is not None
        if same is False:
            suite.different.append(path.name)
    return suite


def compare(
    path: Path, content: Content, independent: trimesh.Trimesh | bool | None
) -> bool | None:
    """Whether a file is read as others do; None where no other reader knows all that is in it."""
    if isinstance(independent, trimesh.Trimesh):
        return None if BEYOND_TRIMESH in path.read_bytes() else equal(content, independent)
    positions = walked(path)
    return None if positions is None else positions == {rounded(p.to_world) for p in content.parts}


def included_files(files: list[Path]) -> set[str]:
    """Names of what Mitsuba's scenes include."""
    names: set[str] = set()
    for path in (path for path in files if path.suffix.lower() == ".xml"):
        try:
            root = ElementTree.parse(path).getroot()
        except (ElementTree.ParseError, LookupError, ValueError, OSError):
            continue
        if root.tag == "scene":
            names |= {Path(row.get("filename", "")).name for row in root.iter("include")}
    return names


def walked(path: Path) -> set[tuple[float, ...]] | None:
    """Places of the simple shapes of an SDFormat file of plain poses; None for any other."""
    if path.suffix.lower() not in (".sdf", ".world"):
        return None
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, LookupError, ValueError, OSError):
        return None
    plain = all(each.tag not in BEYOND_WALK for each in root.iter()) and not any(
        key in each.attrib
        for each in root.iter()
        for key in ("relative_to", "placement_frame", "degrees", "rotation_format")
    )
    shapes = [shape.tag for shape in root.iterfind(".//visual/geometry/*")]
    if not plain or not shapes or any(shape in FROM_FILES for shape in shapes):
        return None
    worlds = root.findall("world")
    return set(positions_below(worlds[0] if worlds else root, np.eye(4)))


def positions_below(element: ElementTree.Element, pose: np.ndarray) -> Iterator[tuple[float, ...]]:
    """Of the visuals in an element that stands at a pose."""
    for child in element:
        if child.tag not in ("model", "link", "visual"):
            continue
        numbers = [float(word) for word in (child.findtext("pose") or "0 0 0 0 0 0").split()]
        own = pose @ pose_matrix(np.degrees(numbers[3:]), numbers[:3])
        if child.tag != "visual":
            yield from positions_below(child, own)
        elif (
            child.find("geometry/*") is not None and float(child.findtext("transparency", "0")) < 1
        ):
            yield rounded(own)


def rounded(pose: np.ndarray) -> tuple[float, ...]:
    """Where a pose is, to a tenth of a millimetre."""
    return tuple(float(value) + 0.0 for value in np.round(pose[:3, 3], 4))


def independent_mesh(path: Path, there: set[str]) -> trimesh.Trimesh | bool | None:
    """All triangles as trimesh has them, True where it does not know their shape, or None.

    `there` are names of the files of the suite.
    """
    if path.suffix.lower() not in COMPARED:
        return holds_shapes(path, there) or None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = trimesh.load_scene(path, process=False, skip_materials=True).to_mesh()
            usable = len(mesh.faces) > 0 and np.isfinite(mesh.bounds).all() and mesh.area > 0
    except Exception:  # whatever trimesh runs into
        return None
    if usable and MORPHED.search(path.read_bytes()):
        return True
    return mesh if usable else None


def holds_shapes(path: Path, there: set[str]) -> bool:
    """Whether a world, robot, stage or scene shows anything that is in its suite."""
    if path.suffix.lower().startswith(".usd"):
        return True
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, LookupError, ValueError, OSError):
        return False
    if root.tag == "scene":
        shapes = (shape.find("string[@name='filename']") for shape in root.iter("shape"))
        return any(file is None or Path(file.get("value", "")).name in there for file in shapes)
    if root.tag not in ("sdf", "robot"):
        return False
    for shape in root.iterfind(".//visual/geometry/*"):
        file = shape.findtext("uri") or shape.get("filename")
        if shape.tag != "empty" and (file is None or Path(file.strip()).name in there):
            return True
    return False


def equal(content: Content, other: trimesh.Trimesh) -> bool:
    """Same number of triangles, same bounds, same area and middle of the area.

    trimesh folds concave polygons over: where it has more area, the vector area is compared alone,
    which folds do not change.
    """
    placed = [as_mesh(p.geometry).copy().apply_transform(p.to_world) for p in content.parts]
    low = np.min([mesh.bounds[0] for mesh in placed], axis=0)
    high = np.max([mesh.bounds[1] for mesh in placed], axis=0)
    if np.abs([low, high] - other.bounds).max() > TOLERANCE * other.extents.max():
        return False
    areas = np.concatenate([mesh.area_faces for mesh in placed])
    if other.area > (1 + TOLERANCE) * areas.sum():
        vectors = sum(mesh.triangles_cross.sum(axis=0) for mesh in placed)
        difference = np.linalg.norm(vectors - other.triangles_cross.sum(axis=0)) / 2
        return bool(difference <= TOLERANCE * other.area)
    middle = np.average(np.concatenate([m.triangles_center for m in placed]), axis=0, weights=areas)
    theirs = np.average(other.triangles_center, axis=0, weights=other.area_faces)
    return (
        len(areas) == len(other.faces)
        and bool(np.abs(middle - theirs).max() <= TOLERANCE * other.extents.max())
        and bool(abs(areas.sum() / other.area - 1) <= TOLERANCE)
    )


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


def time_world(models: int) -> tuple[dict[str, float], float]:
    """Seconds of each command, and of the search for a place of the drone alone."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        world, scene = write_world(folder, models), folder / "world.yaml"
        times = {
            "import": seconds_of("scenes", "import", world, "-o", scene),
            "scenes show": seconds_of("scenes", "show", scene, "-o", folder / "world.png"),
            "simulate": seconds_of("simulate", scene, "-o", folder / "world.h5"),
        }
        meshes = [thing.mesh for thing in load_scene(scene).objects]
        began = time.process_time()
        propose(Surroundings.of(meshes))
        return times, time.process_time() - began


def suite_table(suites: list[Suite]) -> Table:
    """One row for each suite."""
    rows = [
        (
            suite.name,
            str(suite.tried),
            str(suite.tried - suite.empty),
            f"{suite.opened} ({suite.fraction:.1%})",
            f"{suite.compared - len(suite.different)} of {suite.compared}",
            "; ".join(f"{count} {why}" for why, count in suite.refused.most_common(4)) or "–",
        )
        for suite in suites
    ]
    columns = ("suite", "tried", "hold triangles", "opened", "equal to others'", "refused for")
    return Table("Files of others, and what became of them.", columns, rows)


def main() -> int:
    """Run it."""
    logging.disable(logging.ERROR)  # what trimesh and pycollada say of textures
    options = benchmark_options(
        __doc__,
        f"a world of {QUICK_MODELS} models",
        PAGE,
        others={"--suite": SUITE},
    )
    given = (text.partition("=") for text in options.suite)
    suites = [read_suite(name, Path(folder)) for name, _, folder in given]
    models = QUICK_MODELS if options.quick else MODELS
    times, search = time_world(models)
    total = sum(times.values())
    listed = {**times, "together": total, "of which the search for the drone's position": search}
    rows = [(name, f"{seconds:.1f}") for name, seconds in listed.items()]
    tables = [Table(f"A world of {models} models: processor time.", ("command", "s"), rows)]
    checks = [
        Check("large world: import, show and simulate, s", total, SECONDS),
        Check("large world: search for the drone's position, s", search, SEARCH_SECONDS),
    ]
    if suites:
        tables.insert(0, suite_table(suites))
    for suite in suites:
        checks.append(
            Check(f"{suite.name}: fraction opened", suite.fraction, OPENED, at_least=True)
        )
        checks.append(
            Check(f"{suite.name}: different from other importers'", len(suite.different), 0)
        )
        if suite.different:
            print(
                f"{suite.name}: different from other importers': {suite.different}", file=sys.stderr
            )
    around = surroundings(
        ["trimesh", "pycollada", "mitsuba", "usd-core", "DracoPy", "meshoptimizer"]
    )
    return finish(options, PAGE, "benchmark: importing", around, tables, checks)


if __name__ == "__main__":
    sys.exit(main())
