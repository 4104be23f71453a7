"""Zones traced by reciprocity against direct integrals and closed forms; what they measure."""

from dataclasses import replace

import numpy as np
import pytest
import spots_zones
import yaml

import worlds
from instruments import changed
from reconstruction import reconstruct
from reconstruction.ranging.fog.overlap import overlap
from spisim.budget import Target, spot_link
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Ambient, Material
from spisim.scene.bsdf import Mirror
from spisim.simulation import simulate
from spisim.simulation.light import solve
from spisim.simulation.light.spots import ranging_histogram
from spisim.simulation.light.surrogate import BOUNCED, surrogate
from spisim.transport.backend import activate
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.world import build_world

NINE, MANY = load_instrument("tmf8820"), load_instrument("vl53l5cx")
#: A lens that falls off, and a flood brighter at its sides, 5 cm beside the receiver.
ODD = changed(
    "tmf8820",
    zones__flood_falloff=-3.0,
    tof__detector__vignetting=2.0,
    tof__detector__positions_m=[[0.0, 0.05, 0.0]],
)


def at_940(*objects, **options):
    return replace(worlds.scene(*objects, **options), wavelength_nm=940.0)


def beside_a_projector() -> Instrument:
    fields = yaml.safe_load(load_instrument("paper").at_wavelength(940).text)
    del fields["lasers"]
    for section in ("zones", "tof", "filter"):
        fields[section] = yaml.safe_load(NINE.text)[section]
    return Instrument.model_validate(fields)


@pytest.mark.parametrize(
    ("instrument", "scene"),
    [
        (ODD, "edge"),
        *(
            pytest.param(one, scene, marks=pytest.mark.slow)
            for one in (NINE, MANY, ODD)
            for scene in spots_zones.SCENES
            if (one, scene) != (ODD, "edge")
        ),
    ],
)
def test_bins_hold_the_direct_integral(
    instrument: Instrument, scene: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spots_zones, "DOWN", 128)
    z, total = spots_zones.against_integral(instrument, spots_zones.SCENES[scene], 3)
    assert z < 4
    assert abs(total) < 5e-4


@pytest.mark.parametrize("tilt_rad", [0.0, 0.6])
def test_walls_return_their_light_as_the_link_has_it(tilt_rad: float) -> None:
    """A zone of few degrees sees ρ E / π at its middle; E = I₀ cos i / s² of the flood."""
    light = solve(at_940(worlds.plane(2.0, 0.5, tilt_rad)), MANY, spp=8, seed=1)
    normal = np.array([np.sin(tilt_rad), 0, np.cos(tilt_rad)])
    directions, zones = MANY.zones.directions, MANY.zones
    range_m = 2.0 * normal[2] / (directions @ normal)
    irradiance = zones.axial_intensity * (directions @ normal) / range_m**2
    etendue = MANY.tof.detector.aperture_area_m2 * zones.solid_angle * directions[:, 2] ** 4
    sums = light.spot_histogram.sum(axis=1)
    np.testing.assert_allclose(sums, 0.5 / np.pi * irradiance * etendue, rtol=0.03)
    if tilt_rad == 0:
        link = spot_link(MANY, Target(2.0))
        np.testing.assert_allclose(sums * zones.power_w, link.echo_w, rtol=0.01)


def test_fog_echoes_as_the_overlap_of_flood_and_zones_has_it() -> None:
    """Light scattered once: σ/4π · weight · exp(-σ L) per metre of the zone's axis."""
    activate()
    scene = at_940(worlds.plane(200.0, 0.01), extinction_per_m=0.1, albedo=1.0, g=0.0)
    placed, bins = InstrumentView.of(NINE, np.eye(4)), PathLengthBins.up_to(8.0, 0.02)
    budget, seed = PathBudget(2**15, min_launches=32), np.random.SeedSequence(4)
    estimate = ranging_histogram(
        build_world(scene), placed, bins, budget, seed=seed, max_vertices=1
    )
    step_m = 1e-3
    range_m = np.arange(0.3, 3.0, step_m)
    weight, path_m = overlap(NINE.spot_optics, range_m)
    echo = 0.1 / (4 * np.pi) * weight * np.exp(-0.1 * path_m) * step_m
    for low_m, high_m in ((0.8, 1.6), (1.6, 3.0), (3.0, 5.0)):
        within = (bins.centres_m > low_m) & (bins.centres_m < high_m)
        mean, error = (each["histogram_orders"][1][:, within]
                       for each in (estimate.mean, estimate.error))  # fmt: skip
        ours = np.where((path_m > low_m) & (path_m < high_m), echo, 0).sum(axis=1)
        z = (mean.sum(axis=1) - ours) / np.hypot(np.linalg.norm(error, axis=1), 0.01 * ours)
        assert np.abs(z).max() < 4
        assert np.linalg.norm(error) < 0.1 * np.linalg.norm(ours)


def test_zones_that_look_up_see_the_sky() -> None:
    """Its radiance E / π, times the aperture and ∫ cosθ dΩ of each zone."""
    sky = at_940(worlds.plane(-5.0), ambient=Ambient(sky_klx=2.0))
    light = solve(sky, NINE, spp=1, seed=1)
    etendue = NINE.ranging.zone_etendue * NINE.zones.responses(0.0)
    exact = NINE.daylight_irradiance(2.0) / np.pi * etendue
    np.testing.assert_allclose(light.spot_daylight_w, exact, rtol=1e-3)


@pytest.mark.slow
def test_patterns_are_seen_by_the_zones_that_look_at_them() -> None:
    """The middle zone lies in the lit field; a zone at a corner sees less."""
    both = beside_a_projector()
    light = solve(at_940(worlds.plane(4.0)), both, spp=1, seed=1)
    link = spot_link(both, Target(4.0))
    assert light.spot_crosstalk_w[4] == pytest.approx(link.patterns_w[4], rel=0.02)
    np.testing.assert_allclose(light.spot_crosstalk_w, link.patterns_w, rtol=0.2)  # as cones
    assert light.spot_crosstalk_w[0] < 0.3 * light.spot_crosstalk_w[4]


def test_the_surrogate_has_the_light_of_walls_and_guesses_what_bounces() -> None:
    wall = at_940(worlds.plane(2.0, 0.5, 0.4))
    guessed, traced = surrogate(wall, MANY, seed=1), solve(wall, MANY, spp=8, seed=2)
    sums = [light.spot_histogram.sum(axis=1) for light in (guessed, traced)]
    np.testing.assert_allclose(sums[0], (1 + BOUNCED) * sums[1], rtol=0.01)
    room = at_940(*worlds.room())
    guessed, traced = surrogate(room, NINE, seed=1), solve(room, NINE, spp=32, seed=2)
    sums = [light.spot_histogram.sum(axis=1) for light in (guessed, traced)]
    np.testing.assert_allclose(sums[0], sums[1], rtol=0.15)


@pytest.mark.parametrize("distance_m", [1.0, pytest.param(1.5, marks=pytest.mark.slow)])
def test_the_middle_zone_ranges_a_wall_within_a_centimetre(distance_m: float) -> None:
    scene = at_940(worlds.plane(distance_m))
    capture = simulate(scene, NINE, spp=16, frames=2).capture
    for frame in range(2):
        ranges = reconstruct(capture, ranging="dtof", frame=frame).rangings["dtof"]
        assert abs(ranges.range_m[4] - distance_m) < 0.01
    assert capture.truth.at(0).spot_range_m[4] == pytest.approx(distance_m, abs=1e-5)


def test_zones_beside_a_projector_make_a_depth_map() -> None:
    both = beside_a_projector()
    capture = simulate(at_940(worlds.plane(1.5)), both, spp=4).capture
    result = reconstruct(capture, depth=["anchored", "nearest"], weather="clear")
    for name in ("anchored", "nearest"):
        depth = result.depths[name]
        assert np.nanmedian(np.abs(depth - 1.5)) < 0.05


def test_a_mirror_throws_the_flood_into_the_zone_that_looks_at_its_image() -> None:
    """The image of the flood, 2 z ahead: A I₀ / (2 z)², all at one path."""
    distance_m = 2.0
    mirror = Material("mirror", 0.8, "test", Mirror())
    facing = replace(worlds.plane(distance_m), material=mirror)
    light = solve(at_940(facing), NINE, spp=4, seed=1)
    area = NINE.tof.detector.aperture_area_m2
    exact = 0.8 * area * NINE.zones.axial_intensity / (2 * distance_m) ** 2
    assert light.spot_histogram[4].sum() == pytest.approx(exact, rel=1e-3)
    mean_m = light.spot_histogram[4] @ light.path_length_m / light.spot_histogram[4].sum()
    assert mean_m == pytest.approx(2 * distance_m, abs=1e-3)
    assert light.spot_histogram[[0, 1, 2, 3, 5, 6, 7, 8]].sum() < 1e-6 * exact


def test_zones_are_traced_to_a_target_error() -> None:
    room = at_940(*worlds.room())
    for target in (0.5, 0.1):
        light = solve(room, NINE, transport_noise_share=target, seed=1)
        assert 0 < light.spot_noise_share <= target


@pytest.mark.parametrize("instrument", [NINE, MANY], ids=["tmf8820", "vl53l5cx"])
def test_histograms_are_those_of_path_bins_of_a_millimetre(
    instrument: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each bin within 0.5 % of the peak, from the same paths of light."""

    def counts() -> np.ndarray:
        wall = at_940(worlds.plane(1.003, 0.5))
        return np.asarray(simulate(wall, instrument, noise=False, spp=4).capture.spots.counts[0])

    usual = counts()
    longest_m = 2 * instrument.tof.unambiguous_range_m + 1.0
    fine = PathLengthBins.up_to(longest_m, 0.001)
    monkeypatch.setattr("spisim.simulation.light.spots.bins_for", lambda *_: fine)
    reference = counts()
    assert np.abs(usual - reference).max() < 0.005 * reference.max(axis=-1).min()
