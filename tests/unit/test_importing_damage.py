"""Hostile and damaged files: each is read, or refused in a plain sentence, and nothing else."""

import json
import random
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
import trimesh

import foreignscenes as rich
import hostile
import mutants
from foreign import READERS, glb, glb_of_text, tetrahedron
from reconstruction.base.errors import InputError
from spisim.scene.shapes import load_mesh
from spisim_formats import Options, import_scene
from spisim_formats.library.files import Folders
from spisim_formats.library.units import to_metres

SECRET = "hunter2"
#: What Python and the libraries say of themselves.
INSIDES = re.compile(
    r"Traceback|object has no|index out of|out of range|KeyError|NoneType|not subscriptable|<class"
    r"| object at 0x|Error\b|not iterable|unsupported operand|dtype|ufunc|could not convert"
    r"|invalid literal|broadcast|argument|numpy|ndarray|unhashable|expected str|must be str|reshape"
    r"|codec|unpack|padding|buffer is|'\w+' (object|and '\w+')|None\b(?!')|: '\w+'$"
)

Mutate = Callable[[random.Random, tuple[str, ...]], bytes]


def gltf(rng: random.Random, words: tuple[str, ...]) -> bytes:
    return mutants.json_text(mutants.json_mutant(rich.GLTF_BESIDE, rng, words))


def glb_of_mutant(rng: random.Random, words: tuple[str, ...]) -> bytes:
    return glb_of_text(mutants.json_text(mutants.json_mutant(rich.GLTF, rng, words)), rich.BINARY)


def xml(sound: str, rng: random.Random, words: tuple[str, ...]) -> bytes:
    return mutants.xml_mutant(sound, rng, words)


#: Changes that keep the form of a document.
TREES: dict[str, Mutate] = {
    "main.gltf": gltf,
    "main.glb": glb_of_mutant,
    "main.dae": partial(xml, rich.COLLADA),
    "main.sdf": partial(xml, rich.SDF),
    "main.xml": partial(xml, rich.MITSUBA),
}
#: Changes of bytes.
SOUND: dict[str, Callable[[], bytes | str]] = {
    "main.glb": lambda: glb(rich.GLTF, rich.BINARY),
    "main.gltf": lambda: json.dumps(rich.GLTF_BESIDE),
    "main.dae": lambda: rich.COLLADA,
    "binary.ply": lambda: tetrahedron().export(file_type="ply"),
    "text.ply": lambda: tetrahedron().export(file_type="ply", encoding="ascii"),
    "binary.stl": lambda: tetrahedron().export(file_type="stl"),
    "text.stl": lambda: trimesh.exchange.stl.export_stl_ascii(tetrahedron()),
    "text.off": lambda: tetrahedron().export(file_type="off"),
    "main.obj": lambda: rich.OBJ,
    "main.sdf": lambda: rich.SDF,
    "main.xml": lambda: rich.MITSUBA,
}


def bytes_of(name: str, rng: random.Random, words: tuple[str, ...]) -> bytes:
    sound = SOUND[name]()
    return mutants.damaged(sound.encode() if isinstance(sound, str) else sound, rng)


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A file above the folder "in" of what is imported, which no import may read."""
    (tmp_path / "in").mkdir()
    rich.lay_out(tmp_path / "in")
    secret = tmp_path / "secret.obj"
    secret.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\no {SECRET}\nusemtl {SECRET}\nf 1 2 3\n")
    (tmp_path / "in" / "link.obj").symlink_to(secret)
    (tmp_path / "in" / "link").symlink_to(tmp_path)
    (tmp_path / "out").mkdir()
    return secret


def attack(name: str, mutate: Mutate, outside: Path, seed: int, *, whole: int = 0) -> None:
    """Read a mutant; every `whole` th one is imported, with its mesh files."""
    rng = random.Random(f"{name} {seed}")
    file = outside.parent / "in" / name
    file.write_bytes(mutate(rng, mutants.references(str(outside))))
    output = outside.parent / "out" / "scene.yaml"
    reported: list[str] = []
    try:
        if whole and seed % whole == 0:
            options = Options(position_m=(-50.0, 0.0, 1.0), overwrite=True)
            report = import_scene(file, output, options)
            reported = [*report.notes, *report.warnings]
            assert SECRET not in output.read_text()
        elif file.suffix == ".off":
            load_mesh(file)
        else:
            reported = to_metres(READERS[file.suffix](file, Folders.around(file)), 1.0).notes
    except InputError as error:
        reported = [str(error)]
    for text in reported:
        assert "\n" not in text, text
        assert not INSIDES.search(text), text
        assert len(text) < 2000, text
        assert SECRET not in text, text


def survived(attack: Callable[[int], None], outside: Path, seeds: range) -> None:
    given, made = outside.parent / "in", outside.parent / "out"
    hostile.survive(attack, seeds, readable=[given], writable=[given, made])


@pytest.mark.parametrize("name", TREES)
def test_mutants(outside: Path, name: str) -> None:
    survived(partial(attack, name, TREES[name], outside, whole=250), outside, range(400))


@pytest.mark.slow
@pytest.mark.parametrize("name", TREES)
def test_more_mutants(outside: Path, name: str) -> None:
    survived(partial(attack, name, TREES[name], outside, whole=250), outside, range(400, 2000))


@pytest.mark.hours
@pytest.mark.parametrize("name", TREES)
def test_many_mutants(outside: Path, name: str) -> None:
    survived(partial(attack, name, TREES[name], outside, whole=100), outside, range(100_000))


@pytest.mark.parametrize("name", SOUND)
def test_damage(outside: Path, name: str) -> None:
    survived(partial(attack, name, partial(bytes_of, name), outside), outside, range(200))


@pytest.mark.slow
@pytest.mark.parametrize("name", SOUND)
def test_much_damage(outside: Path, name: str) -> None:
    each = partial(attack, name, partial(bytes_of, name), outside, whole=100)
    survived(each, outside, range(10_000))
