"""Zones of an instrument: fields, what is refused, budgets, and how captures store them."""

from typing import Any

import numpy as np
import pytest
import yaml

from instruments import changed
from reconstruction.base.errors import InputError
from spisim.base.config import parse_model
from spisim.budget import Target, range_sigma_m, spot_link
from spisim.budget.eye_safety import class_1_power_w, laser_safety
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.views import InstrumentView
from spisim.simulation.light.sequence import LightSequence
from spisim.simulation.light.solve import Transport
from spisim.simulation.measurement.spots import spot_light

PRESET = load_instrument("vl53l5cx")
SENSORS = "tmf8820", "vl53l5cx", "vl53l8cx"


def refused(match: str, **changes: Any) -> None:
    fields = yaml.safe_load(PRESET.text)
    for section, values in changes.items():
        fields[section] = (fields.get(section) or {}) | values
    with pytest.raises(InputError, match=match):
        parse_model(yaml.safe_dump(fields), Instrument, "mine.yaml")


def test_zones_are_listed_by_rows_from_the_top_left() -> None:
    x, y, z = load_instrument("tmf8820").zones.directions.T
    assert (np.sign(np.round(x, 6)) == [-1, 0, 1] * 3).all()
    assert (np.sign(np.round(y, 6)) == np.repeat([-1, 0, 1], 3)).all()  # y is down
    np.testing.assert_allclose((x / z)[:3], np.tan(np.radians(16.5)) * np.array([-2, 0, 2]) / 3)
    np.testing.assert_allclose((y / z)[::3], np.tan(np.radians(16)) * np.array([-2, 0, 2]) / 3)


@pytest.mark.parametrize("falloff", [-3.0, -1.0, 0.0, 1.0, 4.5])
def test_the_flood_emits_its_power(falloff: float) -> None:
    zones = changed("vl53l5cx", zones__flood_falloff=falloff).zones
    angle = (np.arange(20_000) + 0.5) / 20_000 * np.radians(zones.flood_deg) / 2
    intensity = zones.axial_intensity * np.cos(angle) ** falloff
    power = np.sum(intensity * 2 * np.pi * np.sin(angle)) * (angle[1] - angle[0])
    assert power == pytest.approx(1, rel=1e-6)
    assert zones.peak_intensity == pytest.approx(intensity.max(), rel=1e-4)


def test_all_zones_together_have_the_etendue_of_the_field() -> None:
    """∫ cosθ dΩ over a rectangle of half extents a, b is a sum of arc tangents (view factors)."""
    zones = load_instrument("tmf8820").zones
    a, b = zones.tan_half
    a_over, b_over = a / np.hypot(1, a), b / np.hypot(1, b)
    exact = 2 * (a_over * np.arctan(b / np.hypot(1, a)) + b_over * np.arctan(a / np.hypot(1, b)))
    assert zones.responses(0.0).sum() * zones.solid_angle == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize(
    ("match", "zones"),
    [
        (r"zones.*shape \[9, 8\] has 72 zones; at most 64", {"shape": [9, 8]}),
        (r"zones\.shape", {"shape": [0, 8]}),
        (r"zones\.fov_deg\[0\].*151", {"fov_deg": [151, 45]}),
        (r"flood_deg 40 leaves zones dark, whose middles lie up to 27\.\d+°", {"flood_deg": 40}),
        (r"zones\.flood_deg.*0\.05", {"shape": [1, 1], "flood_deg": 0.05}),
        (r"zones\.crosstalk", {"crosstalk": 0.6}),
        (r"zones\.cover_glass", {"cover_glass": -1e-9}),
        (r"zones\.power_w", {"power_w": 0}),
        (r"field_of_view_deg 65 does not hold the corners of zones\.fov_deg; at least 70\.\d+",
         {"fov_deg": [53, 53]}),
    ],
)  # fmt: skip
def test_impossible_zones_are_refused(match: str, zones: dict[str, Any]) -> None:
    refused(match, zones=zones)


def test_lasers_or_zones_and_not_both_or_neither() -> None:
    refused("lasers and zones are two ways", lasers={"power_w": 1e-3, "directions_deg": [[0, 0]]})
    fields = yaml.safe_load(PRESET.text)
    for missing, match in (
        ("zones", "lasers is missing: lasers and tof make ranges together"),
        ("tof", "tof is missing: zones and tof make ranges together"),
    ):
        left = {name: value for name, value in fields.items() if name != missing}
        with pytest.raises(InputError, match=match):
            parse_model(yaml.safe_dump(left), Instrument, "mine.yaml")


def test_zones_share_one_receiver() -> None:
    fields = yaml.safe_load(PRESET.text)
    fields["tof"]["detector"]["positions_m"] *= 2
    with pytest.raises(InputError, match="has 2 positions; zones share one receiver"):
        parse_model(yaml.safe_dump(fields), Instrument, "mine.yaml")


def test_zones_measure_at_the_same_time() -> None:
    assert PRESET.ranging.spots == 64
    assert PRESET.frame_time_s == PRESET.tof.frame_time_s == pytest.approx(1 / 15, rel=1e-3)


def test_another_power_of_the_flood() -> None:
    assert PRESET.with_laser_power(2.5).zones.power_w == 2.5
    with pytest.raises(InputError, match=r"zones\.power_w"):
        PRESET.with_laser_power(-1)


@pytest.mark.parametrize("name", SENSORS)
def test_classes_of_floods_are_those_of_their_data_sheets(name: str) -> None:
    instrument = load_instrument(name)
    safety, declared = laser_safety(instrument), instrument.eye_safety.laser_class
    assert safety.laser_class == declared == "1"
    stronger = instrument.with_laser_power(1.01 * class_1_power_w(instrument))
    assert laser_safety(stronger).laser_class == "3R"


def test_a_pupil_takes_in_its_part_of_the_flood() -> None:
    """7 mm at 10 cm, a half angle of atan(0.035), of a uniform cone of 32.5°."""
    mean_w = PRESET.tof.emission(PRESET.zones.power_w).mean_w
    part = (1 - np.cos(np.arctan(0.035))) / (1 - np.cos(np.radians(32.5)))
    assert laser_safety(PRESET).mean_w == pytest.approx(part * mean_w, rel=1e-5)


def test_the_link_of_a_wall_is_that_of_the_radiometry() -> None:
    """Each zone sees its part of an evenly lit wall: ρ E / π · A Ω cos⁴, by E = I₀ cos³ / z²."""
    link = spot_link(PRESET, Target(2.0, reflectance=0.5, illuminance_klx=1.0))
    cosine, zones = PRESET.zones.directions[:, 2], PRESET.zones
    etendue = PRESET.tof.detector.aperture_area_m2 * zones.solid_angle * cosine**4
    irradiance = zones.power_w * zones.axial_intensity * cosine**3 / 2.0**2
    np.testing.assert_allclose(link.echo_w, 0.5 / np.pi * irradiance * etendue, rtol=0.01)
    sun = PRESET.daylight_irradiance(1.0)
    np.testing.assert_allclose(link.daylight_w, 0.5 / np.pi * sun * etendue, rtol=0.01)
    np.testing.assert_allclose(link.path_m, 2 * 2.0 / cosine, rtol=1e-3)
    assert np.isfinite(range_sigma_m(PRESET, Target(2.0))).all()


def light_of(instrument: Instrument, histogram: Any) -> Any:
    zones, none = instrument.ranging.spots, np.zeros((1, 1))
    flat = np.zeros(zones)
    light = Transport(
        none, none, histogram, histogram, np.arange(histogram.shape[1]) * 0.02, 0.0, 0.0,
        np.arange(zones) * 1e-12, flat, flat, flat, 0.0, 0.0, 0, 0, 0.0, {},
    )  # fmt: skip
    return spot_light(instrument, LightSequence(np.zeros(1), (light,)), 1)


def test_crosstalk_goes_to_adjacent_zones_and_loses_nothing() -> None:
    leaky = changed("tmf8820", zones__crosstalk=0.08)
    one = np.zeros((9, 5))
    one[0, 3] = 1e-9
    steady = light_of(leaky, one).steady_per_s[0] - leaky.tof.detector.sensor.dark_rate_hz
    echo = light_of(leaky, one).echo_per_s[0, :, 3]
    expected = np.array([0.92, 0.08 / 3, 0, 0.08 / 3, 0.08 / 3, 0, 0, 0, 0])
    np.testing.assert_allclose(echo / echo.sum(), expected, atol=1e-12)
    tight = changed("tmf8820", zones__crosstalk=0.0)
    np.testing.assert_allclose(echo.sum(), light_of(tight, one).echo_per_s.sum())
    dark = tight.tof.detector.sensor.dark_rate_hz
    daylight = light_of(tight, one).steady_per_s[0] - dark
    np.testing.assert_allclose(steady.sum(), daylight.sum())
    assert steady[0] > daylight[0] == 0
    single = replace_zones(tight, shape=(1, 1), crosstalk=0.3)
    np.testing.assert_array_equal(single.zones.mixing, [[1.0]])


@pytest.mark.parametrize(
    ("zone", "adjacent"), [(4, [0, 1, 2, 3, 5, 6, 7, 8]), (5, [1, 2, 4, 7, 8])]
)
def test_adjacent_zones_are_those_that_touch(zone: int, adjacent: list[int]) -> None:
    expected = np.zeros(9)
    expected[adjacent] = 0.08 / len(adjacent)
    expected[zone] = 0.92
    mixing = changed("tmf8820", zones__crosstalk=0.08).zones.mixing
    np.testing.assert_allclose(mixing[:, zone], expected, atol=1e-12)


def replace_zones(instrument: Instrument, **changes: Any) -> Instrument:
    return instrument.model_copy(update={"zones": instrument.zones.model_copy(update=changes)})


def test_cover_glass_returns_light_at_once() -> None:
    behind = changed("tmf8820", zones__cover_glass=9e-8)
    light = light_of(behind, np.zeros((9, 5)))
    per_joule = behind.electrons_per_joule(behind.tof.detector, "laser")
    np.testing.assert_allclose(
        light.echo_per_s[0, :, 0], 1e-8 * behind.zones.power_w * per_joule, rtol=1e-12
    )
    assert (light.echo_per_s[..., 1:] == 0).all()


def test_zones_are_placed_at_the_receiver() -> None:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]], (1.0, 2.0, 3.0)
    view = InstrumentView.of(PRESET, pose)
    np.testing.assert_allclose(view.zones.pose[:3, 3], (1.0, 2.004, 3.0))
    np.testing.assert_allclose(view.beams.origins_m, np.tile((1.0, 2.004, 3.0), (64, 1)))
    np.testing.assert_allclose(view.tof.positions_m[0], (1.0, 2.0, 3.0))
    assert InstrumentView.of(load_instrument("paper"), pose).zones is None


def test_captures_store_zones_the_other_way_round() -> None:
    """A patch at a distance returns to the flood's aperture what the zone receives."""
    optics, zones = PRESET.spot_optics, PRESET.zones
    np.testing.assert_allclose(optics.detector_positions_m, np.tile([-0.004, 0, 0], (64, 1)))
    np.testing.assert_array_equal(optics.directions, zones.directions)
    area = PRESET.tof.detector.aperture_area_m2 * zones.solid_angle * zones.axial_intensity
    np.testing.assert_allclose(
        np.pi * optics.aperture_radii_m**2, area * optics.directions[:, 2] ** 4, rtol=0.01
    )
    assert (optics.falloffs == -1).all()
