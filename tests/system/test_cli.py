"""The command line from outside: what it prints, where, with which exit status, what it leaves."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from commands import mistake, program, spisim
from pictures import read_exr
from reconstruction import Capture, read_capture, write_capture
from spisim.instrument.model import PRESETS
from spisim.scene import scenes_folder
from waiting import SAFETY_S, until

COMMANDS = [
    "demo",
    "simulate",
    "transport",
    "reconstruct",
    "evaluate",
    "export",
    "view",
    "fly",
    "serve",
    "budget",
    "paper",
    "weather",
    "scenes list",
    "scenes show",
    "schema",
    "doctor",
]
SCENES = scenes_folder()
QUICK = ["--spp", "8", "--seed", "3"]


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_an_example_that_is_such_a_command(command: str) -> None:
    run = spisim(*command.split(), "--help")
    assert run.exit_code == 0
    assert f"Example: spisim {command}" in run.stdout


def test_help_lists_all_commands_without_loading_numpy() -> None:
    code = (
        "import sys\nsys.argv = ['spisim', '--help']\nfrom spisim_app.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "assert not {'numpy', 'mitsuba', 'matplotlib', 'h5py'} & set(sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert all(command.split()[0] in run.stdout for command in COMMANDS)


def test_reconstruct_and_evaluate_agree(capture_file: Path, tmp_path: Path) -> None:
    run = spisim("reconstruct", capture_file, "-o", tmp_path / "result", "--json")
    assert run.exit_code == 0, run.stderr
    assert set(json.loads(run.stdout)["files"]) >= {"image.png", "depth.png", "cloud.ply"}
    stored = spisim("evaluate", capture_file, tmp_path / "result", "--json")
    anew = spisim("evaluate", capture_file, "--json")
    assert json.loads(stored.stdout) == json.loads(anew.stdout)
    assert json.loads(anew.stdout)["warnings"] == json.loads(run.stdout)["warnings"]
    assert json.loads(anew.stdout)["images"]["edge-preserving"]["correlation"] > 0.9


def test_evaluate_refuses_the_result_of_another_recording(
    capture: Capture, capture_file: Path, tmp_path: Path
) -> None:
    assert spisim("reconstruct", capture_file, "-o", tmp_path / "result").exit_code == 0
    counts = capture.buckets.counts.copy()
    counts[0, 5] += 1
    other = tmp_path / "other.h5"
    write_capture(replace(capture, buckets=replace(capture.buckets, counts=counts)), other)
    message = mistake("evaluate", other, tmp_path / "result").replace("\n", "")
    assert f"{tmp_path / 'result' / 'result.h5'} for {other}: the result is not one of" in message


def test_evaluate_takes_a_result_of_some_of_the_patterns(
    capture_file: Path, tmp_path: Path
) -> None:
    few = spisim("reconstruct", capture_file, "-o", tmp_path / "few", "--patterns", "20")
    assert few.exit_code == 0, few.stderr
    stored = spisim("evaluate", capture_file, tmp_path / "few", "--json")
    assert stored.exit_code == 0, stored.stderr
    anew = spisim("evaluate", capture_file, "--json")
    images = [json.loads(run.stdout)["images"] for run in (stored, anew)]
    assert images[0]["pursuit"]["correlation"] < images[1]["pursuit"]["correlation"]


def test_evaluate_tells_how_to_make_a_missing_result(capture_file: Path, tmp_path: Path) -> None:
    message = mistake("evaluate", capture_file, tmp_path / "nowhere").replace("\n", " ")
    assert "no such result; run spisim reconstruct CAPTURE -o DIR" in message


def test_evaluate_for_people_is_a_table(capture_file: Path) -> None:
    run = spisim("evaluate", capture_file)
    assert run.exit_code == 0, run.stderr
    assert "correlation" in run.stdout
    assert "standard error of the true image, RMS: 1.0 %" in run.stdout
    assert run.stderr == ""


def test_a_spot_without_a_range_says_why(capture: Capture, tmp_path: Path) -> None:
    assert capture.spots is not None
    saturated = capture.spots.saturated.copy()
    saturated[0, 3] = True
    path = tmp_path / "capture.h5"
    write_capture(replace(capture, spots=replace(capture.spots, saturated=saturated)), path)
    assert "saturated" in spisim("evaluate", path).stdout
    run = spisim("reconstruct", path, "-o", tmp_path / "result")
    assert "saturated" in run.stdout
    assert "spot 3 is saturated" in (tmp_path / "result" / "report.html").read_text()


def test_scenes_are_listed() -> None:
    listing = json.loads(spisim("scenes", "list", "--json").stdout)
    assert "warehouse" in [scene["name"] for scene in listing["scenes"]]
    assert all(scene["description"] for scene in listing["scenes"])


@pytest.mark.parametrize(
    ("kind", "field"),
    [("scene", "objects"), ("instrument", "lasers"), ("plan", "vary"), ("study", "study")],
)
def test_schemas_forbid_unknown_fields(kind: str, field: str) -> None:
    schema = json.loads(spisim("schema", kind).stdout)
    models = [schema["$defs"][one["$ref"].rpartition("/")[2]] for one in schema.get("anyOf", ())]
    for model in models or [schema]:
        assert model["type"] == "object"
        assert model["additionalProperties"] is False
        assert field in model["properties"]


def test_doctor_finds_this_machine_ready() -> None:
    run = spisim("doctor", "--json")
    findings = json.loads(run.stdout)
    assert run.exit_code == 0, findings["problems"]
    assert findings["ready"] is True
    assert "missing" not in findings["packages"].values()


def test_the_package_runs_as_the_command_does() -> None:
    command = [sys.executable, "-m", "spisim", "--version"]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout == spisim("--version").stdout


def test_doctor_tells_an_unusable_llvm(tmp_path: Path) -> None:
    variables = os.environ | {"DRJIT_LIBLLVM_PATH": str(tmp_path / "none.so")}
    run = subprocess.run(
        program("doctor", "--json"), env=variables, capture_output=True, text=True, check=False
    )
    findings = json.loads(run.stdout)
    assert findings["llvm"]["path"] is None
    if not findings["gpu"]:
        assert run.returncode == 1
        assert "is not a file" in findings["problems"][0]


@pytest.mark.slow
def test_simulate_keeps_what_makes_the_capture_again(tmp_path: Path) -> None:
    options = ["--visibility", "30", "--patterns", "64", "--frames", "2", *QUICK, "--json"]
    files = [tmp_path / "a" / "capture.h5", tmp_path / "b" / "capture.h5"]
    first, second = (spisim("simulate", "warehouse", "-o", f, *options) for f in files)
    assert first.exit_code == second.exit_code == 0, first.stderr
    assert json.loads(first.stdout)["written"] == [str(files[0])]
    a, b = map(read_capture, files)
    assert a.frames == 2
    assert a.plan.sampled == 64
    assert "visibility_m: 30" in a.provenance.scene
    assert "patterns: 64" in a.provenance.instrument
    settings = yaml.safe_load(a.provenance.settings)
    light, media = settings.pop("light"), settings.pop("media")
    assert 0 < light["noise_share"] < 1
    assert light["paths"] > 0
    assert media == json.loads(first.stdout)["media"]
    assert media[0]["visibility_m"] == 30
    assert settings | {"backend": ""} == {"spp": 8, "backend": "", "noise": True, "frames": 2}
    assert settings["backend"]
    np.testing.assert_array_equal(a.buckets.counts, b.buckets.counts)
    assert (a.buckets.counts[0] != a.buckets.counts[1]).any()


@pytest.mark.slow
def test_too_much_light_is_warned_about(tmp_path: Path) -> None:
    preset = (PRESETS / "paper.yaml").read_text(encoding="utf-8")
    bright = tmp_path / "bright.yaml"
    bright.write_text(preset.replace("power_w: 6.4 ", "power_w: 1.0e+4 "), encoding="utf-8")
    options = ["--instrument", bright, "-o", tmp_path / "c.h5", *QUICK, "--json"]
    run = spisim("simulate", "warehouse", *options)
    assert run.exit_code == 0, run.stderr
    warnings = json.loads(run.stdout)["warnings"]
    (warning,) = [text for text in warnings if "bucket readings" in text]
    assert "127 of 128 bucket readings (99.2 %) are marked saturated" in warning
    assert f"warning: {warning}" in run.stderr
    assert any("array is in risk group 3" in text for text in warnings)
    message = spisim("simulate", "warehouse", *options, "--report").stderr
    assert (
        f"{tmp_path / 'c.h5'}: frame 0: no image, because every pattern has a saturated reading"
        in message
    )
    assert "record again with less light" in message


def test_transport_keeps_the_name_of_its_histograms(tmp_path: Path) -> None:
    run = spisim("transport", "warehouse", "-o", tmp_path / "w.npz")
    assert run.exit_code == 2
    assert "w.npz" in run.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_transport_writes_named_channels_with_units(tmp_path: Path) -> None:
    run = spisim("transport", "warehouse", "-o", tmp_path / "w.exr", "--clear", *QUICK, "--json")
    assert run.exit_code == 0, run.stderr
    channels, attributes = read_exr(tmp_path / "w.exr")
    assert {"transport", "range_m", "depth_m", "reflectance", "normal.Z"} <= set(channels)
    assert attributes["units.range_m"] == "m"
    hit = np.isfinite(channels["range_m"])
    assert (channels["depth_m"][hit] <= channels["range_m"][hit]).all()
    with np.load(tmp_path / "w.npz") as light:
        assert light["spot_histogram"].shape == (4, light["path_length_m"].size)
    assert json.loads(run.stdout)["paths"] > 0


@pytest.mark.slow
def test_transport_in_other_fogs(tmp_path: Path) -> None:
    fog = ["transport", "target-plane", "--visibility", "50", *QUICK]
    run = spisim(*fog, "-o", tmp_path / "w.exr", "--also-visibility", "40", "--json")
    assert run.exit_code == 0, run.stderr
    assert 0.9 < json.loads(run.stdout)["paths_that_carry"]["40 m"] <= 1
    channels, _ = read_exr(tmp_path / "w.exr")
    assert (channels["transport_at_40m"] != channels["transport"]).any()
    assert (channels["transport_at_40m_error"] > 0).any()
    with np.load(tmp_path / "w.npz") as light:
        assert light["spot_histogram_at_40m"].shape == light["spot_histogram"].shape
    run = spisim(*fog, "-o", tmp_path / "far.exr", "--also-visibility", "3")
    assert run.exit_code == 2
    assert "too far from what was traced" in run.stderr
    assert not list(tmp_path.glob("far.*"))


@pytest.mark.slow
def test_transport_to_order_with_phasors_and_orders(tmp_path: Path) -> None:
    options = ["--transport-noise-share", "1", "--frequency", "15e6", "--orders", "--cube", "0.5"]
    run = spisim("transport", "warehouse", "-o", tmp_path / "w.exr", *options, "--json")
    assert run.exit_code == 0, run.stderr
    channels, _ = read_exr(tmp_path / "w.exr")
    parts = sum(channels[f"transport.{part}"] for part in ("unscattered", "single", "multiple"))
    np.testing.assert_allclose(parts, channels["transport"], rtol=1e-4)
    scale = 1e-5 * channels["transport"].max()
    for part in ("real", "imag"):
        name = "phasor_15MHz"
        parts = sum(channels[f"{name}.{o}.{part}"] for o in ("unscattered", "single", "multiple"))
        np.testing.assert_allclose(parts, channels[f"{name}.{part}"], rtol=0, atol=scale)
    with np.load(tmp_path / "w.npz") as light:
        assert str(light["units.cube_path_length_m"]) == "m"
        assert light["cube_path_length_m"][1] == 0.5
        assert light["cube"].shape == (*channels["transport"].shape, 161)
        image = light["cube"].sum(axis=-1)
        np.testing.assert_allclose(image, channels["transport"], rtol=0, atol=scale)
        for whole, split in (("cube", "cube_orders"), ("spot_histogram", "spot_orders")):
            np.testing.assert_allclose(light[split].sum(axis=0), light[whole], rtol=1e-9)
    phasor = np.hypot(channels["phasor_15MHz.real"], channels["phasor_15MHz.imag"])
    assert (phasor <= channels["transport"] * (1 + 1e-4)).all()
    assert 0 <= channels["coverage"].min() < channels["coverage"].max() == 1


@pytest.mark.slow
def test_what_is_odd_about_a_scene_is_told_and_clear_means_clear(tmp_path: Path) -> None:
    scene = tmp_path / "banks.yaml"
    bank = "{name: %s, size_m: [2, 2, 2], translate_m: [4, 0, 1], extinction_per_m: 0.2}"
    text = (SCENES / "warehouse.yaml").read_text(encoding="utf-8")
    text = text.replace("meshes/", f"{SCENES}/meshes/")
    volumes = f"volumes:\n  - {bank % 'one'}\n  - {bank % 'two'}\n"
    scene.write_text(text + volumes, encoding="utf-8")
    run = spisim("simulate", scene, "-o", tmp_path / "c.h5", *QUICK, "--json")
    assert run.exit_code == 0, run.stderr
    assert "warning: volumes 'one' and 'two' overlap" in " ".join(run.stderr.split())
    assert any("'one' and 'two' overlap" in text for text in json.loads(run.stdout)["warnings"])
    run = spisim("simulate", scene, "-o", tmp_path / "c.h5", *QUICK, "--clear")
    assert run.exit_code == 0, run.stderr
    assert "'one'" not in run.stderr
    assert "volumes" not in read_capture(tmp_path / "c.h5").provenance.scene


@pytest.mark.slow
def test_picture_in_radiance_and_for_the_eye(tmp_path: Path) -> None:
    options = ["--width", "48", "--height", "32", "--spp", "4", "--from", "detector", "--json"]
    run = spisim("picture", "warehouse", "-o", tmp_path / "w.exr", "--pattern", "3", *options)
    assert run.exit_code == 0, run.stderr
    channels, attributes = read_exr(tmp_path / "w.exr")
    assert channels["radiance"].shape == (32, 48)
    assert attributes["units.radiance"] == "W m^-2 sr^-1"
    assert (tmp_path / "w.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(run.stdout)["radiance_mean"] > 0
    message = spisim("picture", "warehouse", "-o", tmp_path / "n.exr", "--pattern", "128")
    assert message.exit_code == 2
    assert "--pattern 128: the plan has exposures 0..127" in message.stderr
    assert not (tmp_path / "n.exr").exists()


@pytest.mark.slow
def test_the_demo_shows_everything(tmp_path: Path) -> None:
    run = spisim("demo", "-o", tmp_path / "demo", *QUICK, "--json")
    assert run.exit_code == 0, run.stderr
    report = json.loads(run.stdout)
    files = {path.name for path in (tmp_path / "demo").iterdir()}
    assert files == set(report["files"])
    assert {"capture.h5", "truth.exr", "image.png", "depth.png", "cloud.ply"} <= files
    assert {"report.html", "overview.png"} <= files
    assert report["metrics"]["images"]["pursuit"]["correlation"] > 0.5
    assert report["metrics"]["depths"]["anchored"]["mae_m"] > 0


TELLING = """
import sys
from rich.progress import Progress
Progress.update = lambda *args, **options: print("tracing", file=sys.stderr, flush=True)
from spisim_app.cli import main
main()
"""


@pytest.mark.slow
def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path) -> None:
    log, output = tmp_path / "log", tmp_path / "out"
    output.mkdir()
    words = ["simulate", "warehouse", "-o", str(output / "c.h5"), "--spp", "100000"]
    with log.open("w") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-c", TELLING, *words], stderr=stderr, text=True
        )
        until(lambda: "tracing" in log.read_text(), process)
        process.send_signal(signal.SIGINT)
        assert process.wait(SAFETY_S) == 130
    message = log.read_text()
    assert "interrupted" in message
    assert "Traceback" not in message
    assert list(output.iterdir()) == []
