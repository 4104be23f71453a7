"""What another package adds by entry points goes through every command, with no change here."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from reconstruction import InputError, read_capture
from spisim.instrument import load_instrument
from spisim.instrument.model import PRESETS

OUTSIDE = Path(__file__).parents[1] / "outside"
SCENE = {"family": "closet", "seed": 1, "dust": {"mass_g_per_m3": 0.01}}
STUDY = {
    "name": "Dust",
    "scenes": [{"family": "closet"}],
    "instrument": "elsewhere.yaml",
    "vary": {"scene.dust.mass_g_per_m3": {"grid": [0.001, 0.1]}},
    "spp": 2,
    "study": {
        "x": "scene.dust.mass_g_per_m3",
        "rounds": 1,
        "metrics": ["image_psnr_db[smoothed]", "depth_mae_m[flat]", "range_bias_m"],
    },
}


def instrument():
    """The paper's, with detectors, time of flight and patterns of the other package."""
    fields = yaml.safe_load((PRESETS / "paper.yaml").read_text())
    fields["projector"]["shape"] = [16, 16]
    fields["plan"] = {
        "basis": "cosines",
        "order": "shuffled",
        "patterns": 250,
        "polarity": "differential",
    }
    for detector in (fields["detector"], fields["tof"]["detector"]):
        detector["sensor"] = detector["sensor"] | {"type": "cooled"}
        del detector["sensor"]["dark_current_na"]
    fields["tof"] = {
        "method": "stopwatch",
        "tick_s": 1e-10,
        "pulse_s": 1e-8,
        "detector": fields["tof"]["detector"],
    }
    return fields


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("outside")
    for name, fields in {"closet": SCENE, "elsewhere": instrument(), "study": STUDY}.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(fields))
    return folder


COMMANDS = """
import json, sys
from typer.testing import CliRunner
from spisim_app.cli import app
outputs = []
for words in sys.argv[1:]:
    done = CliRunner().invoke(app, words.split())
    assert done.exit_code == 0, done.output
    outputs.append(done.stdout)
print(json.dumps(outputs))
"""


def run(folder, *commands):
    """What commands print in an installation that has the other package too."""
    return json.loads(python(folder, "-c", COMMANDS, *commands))


def python(folder, *arguments):
    paths = [str(OUTSIDE), *filter(None, [os.environ.get("PYTHONPATH")])]
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


LISTS = (
    "schema instrument", "schema scene", "scenes list", "dataset export --formats",
    "export --formats",
)  # fmt: skip
IMPORTED = "scenes import big.crate -o crate.yaml --json"
CHAIN = (
    "simulate closet.yaml -o c.h5 --instrument elsewhere.yaml",
    "reconstruct c.h5 -o result --image smoothed,pursuit:walsh --depth flat,nearest",
    "evaluate c.h5 result --json",
    "budget elsewhere.yaml --json",
)


@pytest.fixture(scope="module")
def printed(folder):
    """What each command prints, all in one process."""
    (folder / "big.crate").write_text("200")
    commands = (*LISTS, IMPORTED, *CHAIN)
    return dict(zip(commands, run(folder, *commands), strict=True))


def test_schemas_and_lists_know_it(printed):
    instruments, scenes, families, formats, files = (printed[each] for each in LISTS)
    assert '"cooled"' in instruments
    assert '"dust"' in scenes
    assert "closet" in families
    assert "csv" in formats
    assert "rows: ranges as rows" in files


def test_its_format_is_imported(printed):
    report = json.loads(printed[IMPORTED])
    assert report["bounds_m"] == [[-1, -1, -1], [1, 1, 1]]
    assert report["unit_why"] == "edges are in centimetres"


def test_its_modules_may_be_imported_first(folder):
    imports = "import elsewhere.detector, elsewhere.tof, elsewhere.weather"
    load = "from spisim import load_instrument; print(load_instrument('elsewhere.yaml').tof.method)"
    assert "stopwatch" in python(folder, "-c", f"{imports}; {load}")


def test_it_is_simulated_reconstructed_and_evaluated(folder, printed):
    *_, evaluated, budget = (printed[each] for each in CHAIN)
    page = (folder / "result" / "report.html").read_text()
    assert "Smoothed inverse" in page
    assert "Flat wall" in page
    metrics = json.loads(evaluated)
    assert list(metrics["images"]) == ["smoothed", "pursuit:walsh", "zero-filled"]
    assert metrics["images"]["pursuit:walsh"]["correlation"] > 0.8
    assert list(metrics["depths"]) == ["flat", "nearest"]
    errors = [abs(spot["error_m"]) for spot in metrics["spots"]["stopwatch"]]
    assert max(errors) < 0.1
    assert "stopwatch" in budget
    with pytest.raises(InputError, match=r"'cosines'"):  # without the package
        read_capture(folder / "c.h5")


def test_without_the_package_its_detector_is_told_by_name(folder):
    with pytest.raises(InputError, match=r"detector\.sensor: type 'cooled' is unknown: .*pin"):
        load_instrument(folder / "elsewhere.yaml")


@pytest.mark.slow
def test_it_is_studied_and_exported(folder):
    run(folder, "study study.yaml -o study")
    assert "depth_mae_m[flat]" in (folder / "study" / "summary.csv").read_text()
    run(folder, "dataset export study -o table --format csv")
    assert len((folder / "table" / "samples.csv").read_text().splitlines()) == 2
