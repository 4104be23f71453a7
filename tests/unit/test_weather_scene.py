"""Weather in scene files: what the sections mean together, and mistakes in them."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from reconstruction.base.errors import InputError
from spisim.atmosphere import (
    Blend,
    GammaSizes,
    HenyeyGreenstein,
    LogNormalSizes,
    Particles,
    Tabulated,
    combine,
    fog,
    rain,
    snow,
)
from spisim.atmosphere import lookup as lookup_module
from spisim.atmosphere.mie import particle_optics
from spisim.scene import Scene, SceneWarning, load_scene

SCENE = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [5, 0, 1], material: concrete}
"""
Load = Callable[[str], Scene]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    def from_text(sections: str) -> Scene:
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE + sections)
        return load_scene(path)

    return from_text


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mie theory with few radii, kept beside the test."""
    monkeypatch.setenv("SPISIM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(lookup_module, "particle_optics", lambda *args: particle_optics(*args, 100))
    lookup_module.look_up.cache_clear()
    yield
    lookup_module.look_up.cache_clear()


def test_fog_scatters_by_mie_theory_unless_told_otherwise(load: Load) -> None:
    assert isinstance(load("fog: {visibility_m: 50}").atmosphere.phase, Tabulated)
    plain = load("fog: {visibility_m: 50, phase: hg}").atmosphere.phase
    assert isinstance(plain, HenyeyGreenstein)
    double = load("fog: {visibility_m: 50, phase: double-hg}").atmosphere.phase
    assert isinstance(double, Blend)
    assert double.g == pytest.approx(plain.g)


def test_fog_by_water(load: Load) -> None:
    air = load("fog: {liquid_water_g_per_m3: 0.1, kind: heavy-radiation}").atmosphere
    assert air.water_g_per_m3 == pytest.approx(0.1)
    assert air.visibility_m == pytest.approx(fog(1, "heavy-radiation").water_g_per_m3 / 0.1)
    both = load(
        "fog: {visibility_m: 50, liquid_water_g_per_m3: 0.293, kind: heavy-radiation}"
    ).atmosphere
    assert both.visibility_m == 50


@pytest.mark.usefixtures("own_cache")
def test_fog_and_smoke_with_sizes_of_their_own(load: Load) -> None:
    sizes = "droplets: {alpha: 2, gamma: 1, mode_radius_um: 0.2}"
    air = load(f"fog: {{visibility_m: 500, {sizes}}}").atmosphere
    expected = fog(500, Particles(GammaSizes(2, 1, 0.2)))
    assert air.extinction_per_m == expected.extinction_per_m
    assert air.kind == "droplets"
    smoke = "droplets: {median_diameter_um: 0.3, sigma_g: 1.5, n: 1.6, k: 0.1}"
    air = load(f"smoke: {{visibility_m: 5, {smoke}}}").atmosphere
    expected = fog(5, Particles(LogNormalSizes(0.3, 1.5), 1.6 - 0.1j))
    assert (air.extinction_per_m, air.albedo) == (expected.extinction_per_m, expected.albedo)
    assert (air.kind, air.water_g_per_m3) == ("particles", 0.0)


def test_everything_at_once_is_one_atmosphere(load: Load) -> None:
    air = load(
        "fog: {visibility_m: 100, kind: heavy-radiation}\n"
        "smoke: {visibility_m: 30}\n"
        "rain: {rate_mm_per_h: 12, kind: joss-drizzle, diffraction: include}\n"
        "snow: {rate_mm_per_h: 1, kind: dry, albedo: 0.7, g: 0.9}\n"
    ).atmosphere
    expected = combine(
        [
            fog(100, "heavy-radiation"),
            rain(12, "joss-drizzle", diffraction="include"),
            fog(30, "fog-machine"),
            snow(1, "dry", albedo=0.7, g=0.9),
        ]
    )
    assert air.summary() == expected.summary()
    assert [part.kind for part in air.parts] == [
        "heavy-radiation",
        "rain, 12 mm/h",
        "fog-machine",
        "dry snow, 1 mm/h",
    ]


def test_rain_alone_is_no_mixture(load: Load) -> None:
    assert load("rain: {rate_mm_per_h: 5}").atmosphere.kind == "rain, 5 mm/h"
    assert load("snow: {rate_mm_per_h: 5}").atmosphere.kind == "wet snow, 5 mm/h"
    assert load("").atmosphere.extinction_per_m == 0


def test_smoke_fills_a_box(load: Load) -> None:
    (box,) = load(
        "volumes: [{name: plume, size_m: [1, 1, 1], visibility_m: 3, kind: fog-machine}]"
    ).volumes
    assert box.medium.extinction_per_m == fog(3, "fog-machine").extinction_per_m


def test_weather_that_nature_does_not_have_is_told(load: Load) -> None:
    with pytest.warns(SceneWarning, match=r"5\.05 g/m³ of water; natural fog holds up to 1"):
        load("fog: {visibility_m: 10, kind: heavy-advection}")
    with pytest.warns(SceneWarning, match=r"5\.05 g/m³"):
        load("volumes: [{name: bank, size_m: [1, 1, 1], visibility_m: 10, kind: heavy-advection}]")


def test_sections_can_be_changed_and_left_out(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE + "fog: {visibility_m: 50}\nsnow: {rate_mm_per_h: 1}\n")
    scene = load_scene(path, {"rain": {"rate_mm_per_h": 5}, "snow": None})
    assert [part.kind for part in scene.atmosphere.parts] == ["moderate-radiation", "rain, 5 mm/h"]
    written = tmp_path / "again.yaml"
    written.write_text(scene.text)
    assert load_scene(written).atmosphere.summary() == scene.atmosphere.summary()
    assert "snow" not in yaml.safe_load(scene.text)
    with pytest.raises(InputError, match=r"scene\.yaml: rain\.rate_mm_per_h: .*greater than 0"):
        load_scene(path, {"rain": {"rate_mm_per_h": -5}})


@pytest.mark.parametrize(
    ("sections", "parts"),
    [
        ("fog: {visibility_m: 0}", ["fog.visibility_m", "greater than 0", "0"]),
        ("fog: {visibility_m: .inf}", ["fog.visibility_m", "finite"]),
        ("fog: {visibility_m: 50, kind: heavy-advektion}", ["did you mean 'heavy-advection'"]),
        (
            "fog: {visibility_m: 10, liquid_water_g_per_m3: 5}",
            ["fog", "visibility_m 10", "liquid_water_g_per_m3 5", "contradict", "1.4"],
        ),
        ("fog: {liquid_water_g_per_m3: 0}", ["fog.liquid_water_g_per_m3", "greater than 0"]),
        (
            "fog: {liquid_water_g_per_m3: 1, extinction_per_m: 1}",
            ["fog", "visibility_m or extinction_per_m"],
        ),
        ("fog: {liquid_water_g_per_m3: 1, kind: soot}", ["fog", "not water"]),
        ("fog: {visibility_m: 50, phase: mei}", ["fog.phase", "'mie'", "double-hg", "mei"]),
        ("fog: {extinction_per_m: 1, phase: mie}", ["phase does not go with extinction_per_m"]),
        ("fog: {visibility_m: 50, phase: {g: 0.8}}", ["visibility_m", "mie, double-hg, hg"]),
        (
            "fog: {visibility_m: 50, kind: haze-l, droplets: {sigma_g: 1.5}}",
            ["fog", "needs alpha, gamma and mode_radius_um, or"],
        ),
        (
            "fog: {visibility_m: 5, kind: haze-l, droplets: {sigma_g: 1.5, median_diameter_um: 1}}",
            ["fog", "kind or droplets, not both"],
        ),
        (
            "fog: {visibility_m: 50, droplets: {alpha: 1, gamma: 1, sigma_g: 1.5}}",
            ["fog.droplets", "needs alpha, gamma and mode_radius_um, or"],
        ),
        (
            "fog: {visibility_m: 50, droplets: {alpha: -1, gamma: 1, mode_radius_um: 5}}",
            ["fog", "alpha should lie between 0.1 and 50", "-1"],
        ),
        (
            "fog: {visibility_m: 5, droplets: {median_diameter_um: 90, sigma_g: 2.5}}",
            ["fog", "converges", "up to 300"],
        ),
        (
            "smoke: {visibility_m: 5, droplets: {median_diameter_um: 1, sigma_g: 1.5, n: 0.3}}",
            ["smoke", "n should lie between 1.0001 and 4", "0.3"],
        ),
        (
            "smoke: {visibility_m: 5,"
            " droplets: {median_diameter_um: 1, sigma_g: 1.5, n: 1.5, k: -2}}",
            ["smoke", "k should lie between 0 and 4", "-2"],
        ),
        (
            "smoke: {visibility_m: 5, droplets: {median_diameter_um: 1, sigma_g: 2, k: 0.1}}",
            ["smoke.droplets", "k needs n"],
        ),
        ("smoke: {kind: soot}", ["smoke", "visibility_m or extinction_per_m"]),
        ("rain: {rate_mm_per_h: 301}", ["rain", "rate_mm_per_h", "300", "301"]),
        ("rain: {rate_mm_per_h: -1}", ["rain.rate_mm_per_h", "greater than 0", "-1"]),
        ("rain: {}", ["rain.rate_mm_per_h", "missing"]),
        ("rain: 10", ["rain", "mapping", "10"]),
        ("rain: {rate_mm_per_h: 5, kind: joss-dizzle}", ["rain", "mean 'joss-drizzle'"]),
        ("rain: {rate_mm_per_h: 5, diffraction: keep}", ["rain.diffraction", "'include'", "keep"]),
        ("snow: {rate_mm_per_h: 30}", ["snow", "rate_mm_per_h", "20", "30"]),
        ("snow: {rate_mm_per_h: 3, kind: powder}", ["snow", "wet, dry"]),
        ("snow: {rate_mm_per_h: 3, albedo: 2}", ["snow.albedo", "2"]),
        (
            "rain: {rate_mm_per_h: 3, model: drops, diffraction: remove}",
            ["rain", "diffraction does not go with model drops"],
        ),
        (
            "snow: {rate_mm_per_h: 3, model: drops, kind: wet}",
            ["snow", "kind does not go with model drops"],
        ),
        (
            "snow: {rate_mm_per_h: 3, fall_speed_m_s: 1}",
            ["snow", "fall_speed_m_s does not go with model medium"],
        ),
        (
            "snow: {rate_mm_per_h: 3, model: drops, flake_density_kg_m3: 950}",
            ["snow", "flake_density_kg_m3", "917", "950"],
        ),
    ],
)
def test_mistake_in_the_weather(load: Load, sections: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        load(sections)
    message = str(caught.value)
    for part in ("scene.yaml", *parts):
        assert part in message
    assert len(message.splitlines()) == 1


def test_a_scene_tells_its_media(load: Load) -> None:
    assert load("").media_summary() == []
    only = load("fog: {visibility_m: 50}").media_summary()
    assert [medium["where"] for medium in only] == ["air"]
    position = load(
        "fog: {visibility_m: 50}\nrain: {rate_mm_per_h: 10}\nvolumes:\n"
        "  - {name: bank, size_m: [1, 1, 1], translate_m: [2, 0, 1], visibility_m: 20}\n"
    )
    media = position.media_summary()
    assert [medium["where"] for medium in media] == ["air", "air, part", "air, part", "volume bank"]
    air, mist, drops, bank = media
    assert air["extinction_per_m"] == pytest.approx(
        mist["extinction_per_m"] + drops["extinction_per_m"]
    )
    assert mist["visibility_m"] == 50
    assert bank["visibility_m"] == 20
    fields = {"extinction_per_m", "albedo", "g", "backscatter_per_sr", "water_g_per_m3"}
    for medium in media:
        assert all(isinstance(medium[field], float) for field in fields)
    assert yaml.safe_load(yaml.safe_dump(media)) == media  # as a capture keeps them


def test_schema_knows_the_weather() -> None:
    from spisim.scene.description import SceneDescription

    schema = SceneDescription.model_json_schema()
    assert {"fog", "smoke", "rain", "snow"} <= set(schema["properties"])
    text = json.dumps(schema)
    assert '"double-hg"' in text
    assert "liquid_water_g_per_m3" in text
