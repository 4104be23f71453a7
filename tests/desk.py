"""A folder as users have them, for commands: good inputs, bad ones, foreign files, odd things."""

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
import yaml

from commands import spisim
from datasets import make_set
from foreign import collada
from reconstruction import Capture, write_capture
from scenefiles import MINIMAL
from spisim.instrument.model import PRESETS
from spisim_formats.library.writing import MAX_NAME

FLIGHT = "t,x,y,z,look_x,look_y,look_z\n0,0,0,1,5,0,1\n1,0.5,0,1,5,0,1\n"
PLAN = {
    "name": "walls",
    "samples": 3,
    "scenes": [{"family": "targets"}],
    "vary": {"scene.fog.visibility_m": {"uniform": [20.0, 90.0]}},
}
STUDY = {
    "name": "walls",
    "scenes": [{"scene": "target-plane"}],
    "vary": {"scene.fog.visibility_m": {"grid": [20, 100]}},
    "spp": 8,
    "study": {"x": "scene.fog.visibility_m", "rounds": 2, "metrics": ["range_bias_m"]},
}
SDF = """<sdf version="1.7"><world name="w"><model name="m"><link name="l"><visual name="v">
<geometry><box><size>1 1 1</size></box></geometry></visual></link></model></world></sdf>"""
MITSUBA = """<scene version="3.0.0"><shape type="cube"><bsdf type="diffuse"/></shape></scene>"""

#: What users may have lying about under the names of outputs.
TAKEN = (
    *("capture.h5", "truth.exr", "overview.png", "report.html", "result.h5", "cloud.ply"),
    *("image.png", "depth.png", "image_pursuit.png", "depth_nearest.png", "flight.gif"),
    *("flight.html", "flight.csv", "capture-0000.h5", "results.csv", "summary.csv", "study.yaml"),
    *("differences.csv", "fig2.png", "table2.png", "shard-000000.tar", "plan.yaml"),
    *("manifest.sqlite", "scene.yaml", "sheet.html", "view.png", "budget.png", "light.npz"),
)


def lay_out(desk: Path, capture: Capture) -> None:
    """Fill the folder; commands of `tests/data/bad_inputs` are run in it."""
    _good(desk, capture)
    _damaged(desk)
    _foreign(desk)
    _odd(desk)


def _good(desk: Path, capture: Capture) -> None:
    wall = trimesh.creation.box((1, 1, 1))
    for name in ("box.ply", "box.obj", "box.stl", "box.glb"):
        wall.export(desk / name)
    (desk / "s.yaml").write_text(MINIMAL)
    (desk / "mesh.yaml").write_text(
        MINIMAL + "  - {name: b, mesh: box.ply, translate_m: [4, 0, 1], material: concrete}\n"
    )
    fog = "fog: {visibility_m: 50}\n"
    (desk / "fog.yaml").write_text(MINIMAL + fog)
    shutil.copy(PRESETS / "paper.yaml", desk / "i.yaml")
    (desk / "flight.csv").write_text(FLIGHT)
    (desk / "plan.yaml").write_text(yaml.safe_dump(PLAN))
    (desk / "study.yaml").write_text(yaml.safe_dump(STUDY))
    (desk / "wedge.dae").write_text(collada())
    (desk / "world.sdf").write_text(SDF)
    (desk / "room.xml").write_text(MITSUBA)
    (desk / "map.yaml").write_text("box: concrete\n")
    np.save(desk / "readings.npy", np.arange(64.0))
    np.savez(desk / "readings.npz", data=np.arange(64.0), words=np.array(["a", "b"]))
    (desk / "readings.csv").write_text("\n".join(map(str, range(64))))
    (desk / "table.csv").write_text("row;counts\n" + "\n".join(f"{k};{k % 7}" for k in range(64)))
    np.save(desk / "zeros.npy", np.zeros((1, 64)))
    np.save(desk / "complex.npy", np.arange(6.0) + 1j)
    np.save(desk / "gap.npy", np.append(np.arange(63.0), np.nan))
    (desk / "rig.yaml").write_text("electrons_per_count: 12\ngain: 3\n")
    (desk / "half.yaml").write_text("electrons_per_count: twelve\n")
    np.savez(desk / "cat_spectraldata.npz", spectral_data=np.ones((4, 2)))
    np.savez(desk / "dog_spectraldata.npz", spectral_data=np.ones((4, 2)))
    acquisition = {
        "class_description": "Acquisition parameters",
        "pattern_dimension_x": 8,
        "pattern_dimension_y": 8,
        "patterns": "[0, 1, __import__('os').system('touch owned')]",
    }
    (desk / "cat_metadata.json").write_text(json.dumps([acquisition]))
    write_capture(capture, desk / "c.h5")
    recorded = replace(capture.provenance, source="hardware", scene="", seed=None)
    write_capture(replace(capture, provenance=recorded, truth=None), desk / "recorded.h5")
    write_capture(replace(capture, spots=None, optics=None), desk / "image-only.h5")
    make_set(desk / "set", capture, done=3, failed=1)
    make_set(desk / "failed-set", capture, done=0, failed=2)
    run = spisim("reconstruct", desk / "c.h5", "-o", desk / "result")
    assert run.exit_code == 0, run.stderr


def _damaged(desk: Path) -> None:
    whole = (desk / "c.h5").read_bytes()
    (desk / "cut.h5").write_bytes(whole[: len(whole) // 2])
    (desk / "flipped.h5").write_bytes(whole[:9000] + bytes([whole[9000] ^ 255]) + whole[9001:])
    (desk / "head.h5").write_bytes(whole[:600])
    for name in ("c.h5", "s.yaml", "i.yaml", "plan.yaml", "study.yaml", "flight.csv", "box.ply"):
        (desk / f"empty{Path(name).suffix}").write_bytes(b"")
    for suffix in ("npy", "npz", "mat", "glb", "gltf", "obj", "stl", "dae", "sdf", "xml", "tum"):
        (desk / f"empty.{suffix}").write_bytes(b"")
        (desk / f"noise.{suffix}").write_bytes(np.random.default_rng(1).bytes(300))
    for suffix in ("yaml", "csv", "ply", "h5"):
        (desk / f"noise.{suffix}").write_bytes(np.random.default_rng(1).bytes(300))
    (desk / "latin.yaml").write_bytes("name: caf\xe9\n".encode("latin-1"))
    (desk / "utf16.yaml").write_bytes("name: wall\n".encode("utf-16"))
    (desk / "nul.yaml").write_bytes(b"name: \0\n")
    (desk / "objects.npy").write_bytes(_pickled())
    shutil.copytree(desk / "result", desk / "cut-result")
    result = (desk / "result" / "result.h5").read_bytes()
    (desk / "cut-result" / "result.h5").write_bytes(result[:2000])
    shutil.copytree(desk / "set", desk / "lost-set")
    (desk / "lost-set" / "manifest.sqlite").unlink()
    shutil.copytree(desk / "set", desk / "noise-set")
    (desk / "noise-set" / "manifest.sqlite").write_bytes(b"no database" * 100)
    shutil.copytree(desk / "set", desk / "gone-set")
    (desk / "gone-set" / "samples" / "000" / "000001.h5").unlink()


def _pickled() -> bytes:
    import io

    buffer = io.BytesIO()
    np.save(buffer, np.array([{}], object), allow_pickle=True)
    return buffer.getvalue()


def _foreign(desk: Path) -> None:
    for suffix in ("txt", "md", "h5", "hdf5", "exr", "npz", "png", "html", "csv", "svg"):
        (desk / f"notes.{suffix}").write_text("Notes of mine, which nobody else has.\n")
    (desk / "notes.yaml").write_text("notes: of mine\n")
    (desk / "list.yaml").write_text("- 1\n- 2\n")
    (desk / "word.yaml").write_text("word\n")
    (desk / "taken").mkdir()
    for name in TAKEN:
        (desk / "taken" / name).write_text("Mine.\n")
    (desk / "notes-meshes").mkdir()
    (desk / "notes-meshes" / "notes.txt").write_text("Mine.\n")
    (desk / "scene-meshes").write_text("Mine.\n")
    (desk / "paper.md").write_text("No marks here.\n")
    (desk / "half.md").write_text("<!-- paper -->\n")
    (desk / "picture.md").write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    (desk / "marks.md").write_text("<!-- paper -->\n<!-- /paper -->\n")


def _odd(desk: Path) -> None:
    for name in ("folder", "folder.h5", "folder.exr", "folder.html", "folder.png", "folder.yaml"):
        (desk / name).mkdir()
    (desk / "folder" / "notes.txt").write_text("Mine.\n")
    for name in ("x.npz", "x.html", "view.png"):
        (desk / name).mkdir()
    (desk / "link.h5").symlink_to("c.h5")
    (desk / "link.png").symlink_to("notes.png")
    (desk / "link.yaml").symlink_to("s.yaml")
    (desk / "endless.yaml").symlink_to("/dev/zero")
    (desk / "endless.csv").symlink_to("/dev/zero")
    (desk / "endless.h5").symlink_to("/dev/zero")
    (desk / "dangling.h5").symlink_to("nowhere.h5")
    (desk / "dangling.html").symlink_to("nowhere.html")
    (desk / "loop.h5").symlink_to("loop.h5")
    (desk / "hard.h5").hardlink_to(desk / "c.h5")
    (desk / "hard.png").hardlink_to(desk / "s.yaml")
    os.mkfifo(desk / "pipe.h5")
    os.mkfifo(desk / "pipe.yaml")
    (desk / ("n" * MAX_NAME)).write_text("Mine.\n")
