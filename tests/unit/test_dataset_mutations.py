"""Plans, scenes, instruments and manifests changed by seeds: read, or refused in a sentence."""

import shutil
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import yaml

from datasets import put_captures
from hostile import survive
from mutations import mutate_manifest, mutated_yaml
from reconstruction import Capture, InputError
from runs import PLAN, Run, write_plan
from spisim.base.config import parse_model, shipped
from spisim.dataset import open as open_data_set
from spisim.dataset import verify
from spisim.dataset.manifest import Manifest
from spisim.dataset.opening import opened
from spisim.dataset.planned import load_plan
from spisim.dataset.records import failure
from spisim.dataset.sample import load
from spisim.dataset.status import status_of
from spisim.dataset.study.plan import StudyPlan
from spisim.instrument import Instrument
from spisim.instrument.model import PRESETS
from spisim.scene.description import SceneDescription
from spisim_formats.samples.webdataset import write_shards

FULL_PLAN = """
name: some
description: words
samples: 7
seed: 3
scenes:
  - {family: targets, parameters: {distance_m: {uniform: [2.0, 6.0]}}, distinct: 4, weight: 2}
  - {scene: warehouse}
vary:
  scene.fog: {kind: moderate-radiation}
  scene.fog.visibility_m: {grid: [20, {log_uniform: [20, 200]}]}
  scene.drone.offset_m: [{normal: [0, 0.2], within: [-1, 1]}, 0, 0]
  together: {choice: [{instrument.lasers.power_w: 0.001}, {scene.fog.albedo: 0.9}]}
materials: {concrete: {choice: [cardboard, wood-dry], weights: [1, 2]}}
instrument: {grid: [paper, paper]}
wavelength_nm: {uniform: [1500, 1560]}
transport_noise_share: 0.3
frames: 2
keep: {transport: true}
"""
KEEPS = f"{PLAN.replace('5', '2')}keep: {{histograms: true}}\n"
FEW, FAST, MANY = range(200), range(500), range(100_000)
seeds = pytest.mark.parametrize(
    "seeds", [FAST, pytest.param(MANY, marks=pytest.mark.hours)], ids=["500", "100000"]
)


def files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.yaml"))


def brief(error: InputError) -> None:
    """A sentence or two, without Python's insides."""
    text = str(error)
    assert len(text) < 3000, text[:500]
    assert "Error(" not in text
    assert "object at 0x" not in text


@seeds
def test_plans(place: Path, seeds: range, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPISIM_CACHE", str(place / "cache"))
    base = yaml.safe_load(FULL_PLAN)

    def attack(seed: int) -> None:
        path = place / "plan.yaml"
        path.write_bytes(mutated_yaml(base, seed).encode(errors="surrogatepass"))
        try:
            planned = load_plan(path)
            for index in (0, planned.plan.size - 1):
                sample = planned.sample(index)
            if seed % 50 == 0:
                assert len(planned.digest) == 64
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    load(sample)
        except InputError as error:
            brief(error)

    survive(attack, seeds, readable=[place], writable=[place])


MODELS: dict[str, tuple[Callable[[], list[Path]], Any]] = {
    "scenes": (lambda: files(shipped("scenes")), SceneDescription),
    "instruments": (lambda: files(PRESETS), Instrument),
    "studies": (lambda: files(shipped("studies")), StudyPlan),
}


@pytest.mark.parametrize("kind", MODELS)
@pytest.mark.parametrize(
    "seeds", [FEW, pytest.param(MANY, marks=pytest.mark.hours)], ids=["200", "100000"]
)
def test_files_of_fields(tmp_path: Path, seeds: range, kind: str) -> None:
    find, model = MODELS[kind]
    bases = [yaml.safe_load(file.read_text(encoding="utf-8")) for file in find()]

    def attack(seed: int) -> None:
        try:
            parse_model(mutated_yaml(bases[seed % len(bases)], seed), model, "some.yaml", tmp_path)
        except InputError as error:
            brief(error)

    survive(attack, seeds, readable=[tmp_path])


@seeds
def test_manifests(place: Path, capture: Capture, seeds: range) -> None:
    planned, whole = write_plan(place, KEEPS), place / "whole"
    put_captures(planned, whole, capture)
    Run(planned, whole)
    key, work = place / "key", place / "work"
    key.write_text("secret")

    def attack(seed: int) -> None:
        shutil.rmtree(work, ignore_errors=True)
        folder = shutil.copytree(whole, work / "set")
        mutate_manifest(folder / "manifest.sqlite", seed)
        rarely = resume if seed % 40 == 0 else begin
        for use in (status_of, (verify, export, rarely)[seed % 3]):
            try:
                use(folder)
            except InputError as error:
                brief(error)
        assert {path.name for path in work.iterdir()} <= {"set", "shards"}
        assert key.read_text() == "secret"

    def export(folder: Path) -> None:
        data = open_data_set(folder)
        for sample in data:
            assert sample.path.parent == folder / "samples/000"
            with suppress(InputError):
                sample.array("x")
        data.where(lambda reported: True).split(1, 0, 0)
        for shard in write_shards(data, folder.parent / "shards"):
            assert b"secret" not in shard.read_bytes()

    def begin(folder: Path) -> None:
        with Manifest.open(folder / "manifest.sqlite") as manifest:
            manifest.to_do(len(manifest.files()))
            manifest.record(failure(1, "no luck"))

    def resume(folder: Path) -> None:
        with opened(planned, folder, lambda said: None) as manifest:
            manifest.to_do(2)

    survive(attack, seeds, readable=[place], writable=[place])
