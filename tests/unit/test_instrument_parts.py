"""Instruments of an image alone, of ranges alone, and of other numbers of spots."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from captures import with_spots
from instruments import PAPER, changed
from reconstruction import evaluate, read_capture, reconstruct, write_capture
from reconstruction.base.errors import InputError
from spisim.base.config import parse_model
from spisim.budget import Target, bucket_link, budget_warnings, range_sigma_m, spot_link
from spisim.budget.report import summarise
from spisim.instrument import Instrument, load_instrument
from spisim.scene import load_scene
from spisim.simulation import Simulation, simulate
from spisim.simulation.light import surrogate
from spisim.simulation.light.lattice import Lattice
from spisim.simulation.measurement import record_frames
from spisim_app.report.capture import write_report

WALL = Target(4.0, illuminance_klx=20.0)
IMAGING, RANGING = ("projector", "plan", "detector"), ("lasers", "tof")
MORE_SPOTS = [[0.0, 6.0], [6.0, 0.0], [0.0, -6.0]]


def without(*names: str) -> Instrument:
    fields = yaml.safe_load(PAPER)
    left = {name: value for name, value in fields.items() if name not in names}
    return parse_model(yaml.safe_dump(left), Instrument, "mine.yaml")


def of_seven_spots() -> Instrument:
    paper = load_instrument("paper")
    directions = [*map(list, paper.ranging.lasers.directions_deg), *MORE_SPOTS]
    positions = [*map(list, paper.ranging.tof.detector.positions_m)] + [[0.0, 0.01, 0.0]] * 3
    return changed("paper", lasers__directions_deg=directions, tof__detector__positions_m=positions)


@cache
def simulated(missing: tuple[str, ...], **options: Any) -> Simulation:
    return simulate(load_scene("target-plane"), without(*missing), spp=4, frames=2, **options)


@pytest.mark.parametrize(
    ("missing", "message"),
    [
        ((*IMAGING, *RANGING), "the instrument is empty: projector, plan and detector make an"),
        (("plan", "detector"), "plan and detector are missing: projector, plan and detector make"),
        (("lasers",), "lasers is missing: lasers and tof make ranges together"),
        (("plan", "tof"), r"2 errors: \(1\) plan is missing.* \(2\) tof is missing"),
    ],
)
def test_parts_come_together(missing: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        without(*missing)


def test_a_missing_side_is_named() -> None:
    with pytest.raises(InputError, match="no ranges: lasers and tof are missing"):
        without(*RANGING).with_laser_power(1e-3)
    with pytest.raises(InputError, match="no image: projector, plan and detector are missing"):
        bucket_link(without(*IMAGING), WALL)


def test_a_camera_alone_reads_what_it_reads_beside_lasers() -> None:
    alone, both = simulated(RANGING), simulated(())
    np.testing.assert_array_equal(alone.capture.buckets.counts, both.capture.buckets.counts)
    np.testing.assert_array_equal(alone.transport.image, both.transport.image)
    assert alone.capture.spots is None
    assert alone.transport.spot_histogram.size == 0


@pytest.mark.parametrize("light", ["traced", "surrogate"])
def test_lasers_alone_range_the_wall(light: str) -> None:
    capture = simulated(IMAGING, light=light).capture
    assert not capture.plan.shows_image
    assert capture.truth is not None
    ranges = reconstruct(capture, ranging="cw").rangings["cw"]
    z_scores = (ranges.range_m - capture.truth.at(0).spot_range_m) / ranges.sigma_m
    assert np.abs(z_scores).max() < 4


def test_lasers_alone_have_the_light_that_they_have_beside_a_projector() -> None:
    alone, both = simulated(IMAGING), simulated(())
    np.testing.assert_array_equal(alone.transport.spot_histogram, both.transport.spot_histogram)
    assert (alone.transport.spot_crosstalk_w == 0).all()


@pytest.mark.parametrize("missing", [IMAGING, RANGING])
def test_file_report_and_evaluation_of_one_side(missing: tuple[str, ...], tmp_path: Path) -> None:
    simulation = simulated(missing)
    write_capture(simulation.capture, tmp_path / "c.h5")
    capture = read_capture(tmp_path / "c.h5")
    result = reconstruct(capture)
    metrics = evaluate(result, capture)
    assert bool(metrics["images"]) == (missing == RANGING)
    assert bool(metrics["spots"]) == (missing == IMAGING)
    page = tmp_path / "c.html"
    write_report(page, capture, result, metrics=metrics, transport=simulation.transport)
    text = page.read_text(encoding="utf-8")
    assert ("<h2>Image</h2>" in text) == (missing == RANGING)
    assert ("Laser spots" in text) == (missing == IMAGING)


def test_budgets_of_one_side_are_those_of_both() -> None:
    from spisim.atmosphere import fog

    both = summarise(load_instrument("paper"), WALL, fog(50, "moderate-radiation"))
    image = summarise(without(*RANGING), WALL, fog(50, "moderate-radiation"))
    ranges = summarise(without(*IMAGING), WALL, fog(50, "moderate-radiation"))
    assert image["image"] == both["image"]
    assert ranges["spots"]["signal_w"] == both["spots"]["signal_w"]
    assert ranges["spots"]["patterns_w"] == 0
    assert image["spots"] is image["range"] is image["fog"] is ranges["image"] is None


def test_spots_of_another_number_have_the_light_of_the_closed_form() -> None:
    seven, paper = of_seven_spots(), load_instrument("paper")
    link, four = spot_link(seven, WALL), spot_link(paper, WALL)
    np.testing.assert_allclose(link.echo_w[:4], four.echo_w, rtol=1e-12)
    np.testing.assert_allclose(range_sigma_m(seven, WALL)[:4], range_sigma_m(paper, WALL))
    assert np.isfinite(range_sigma_m(seven, WALL)).all()
    assert budget_warnings(seven, WALL) == budget_warnings(paper, WALL)


def test_one_spot_is_seen_along_its_beam() -> None:
    one = changed(
        "paper", lasers__directions_deg=[[3, 0]], tof__detector__positions_m=[[0.01, 0, 0]]
    )
    np.testing.assert_allclose(one.spot_optics.detector_axes, one.ranging.lasers.directions)
    assert one.ranging.frame_time_s == one.ranging.tof.frame_time_s


def test_numbers_of_spots_and_photodiodes_fit() -> None:
    with pytest.raises(InputError, match=r"positions_m has 4 positions.*directions_deg 1 spots"):
        parse_model(
            yaml.safe_dump(
                yaml.safe_load(PAPER) | {"lasers": {"power_w": 1e-3, "directions_deg": [[0, 0]]}}
            ),
            Instrument,
            "mine.yaml",
        )


@pytest.mark.parametrize("light", ["traced", "surrogate"])
def test_a_capture_of_seven_spots_has_their_readings_truth_and_page(
    light: Any, tmp_path: Path
) -> None:
    """The first four are those of the paper; the others meet the wall where their rays do."""
    scene, instrument = load_scene("target-plane"), of_seven_spots()
    capture = simulated(()).capture
    spp = 4 if light == "traced" else None
    seven = simulate(scene, instrument, light=light, spp=spp, frames=2, noise=False)
    assert seven.capture.spots is not None is not capture.spots
    assert seven.capture.truth is not None is not capture.truth
    assert seven.capture.spots.readings.shape == (2, 7, 4)
    true_m = seven.capture.truth.spot_range_m
    np.testing.assert_array_equal(true_m[:, :4], capture.truth.spot_range_m)
    np.testing.assert_allclose(
        true_m * seven.capture.spots.directions[:, 2], true_m[0, 0] * capture.spots.directions[0, 2]
    )
    signal = np.ptp(seven.capture.spots.readings, axis=2)
    assert signal[:, 4:].min() > 0.8 * signal[:, :4].min()
    write_report(tmp_path / "c.html", seven.capture, reconstruct(seven.capture),
                 transport=seven.transport)  # fmt: skip
    assert "spot 6<" in (tmp_path / "c.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("spots", [0, 65])
def test_instruments_have_1_to_64_spots(spots: int) -> None:
    fields = yaml.safe_load(PAPER)
    fields["lasers"]["directions_deg"] = [[0.0, 0.0]] * spots
    fields["tof"]["detector"]["positions_m"] = [[0.0, 0.01, 0.0]]
    with pytest.raises(InputError, match=r"lasers\.directions_deg"):
        parse_model(yaml.safe_dump(fields), Instrument, "mine.yaml")


def test_a_recording_of_seven_spots_is_read_and_reconstructed(tmp_path: Path) -> None:
    capture = simulated(()).capture
    order = [0, 1, 2, 3, 0, 1, 2]
    seven = with_spots(capture, order)
    write_capture(seven, tmp_path / "c.h5")
    copy = read_capture(tmp_path / "c.h5")
    assert copy.spots is not None
    np.testing.assert_array_equal(copy.spots.readings, seven.spots.readings)
    result = reconstruct(copy)
    four = reconstruct(capture)
    np.testing.assert_array_equal(result.image, four.image)
    for name, ranges in result.rangings["cw"].__dict__.items():
        if name in ("range_m", "sigma_m"):
            np.testing.assert_allclose(ranges, getattr(four.rangings["cw"], name)[order])
    assert list(result.rangings) == list(four.rangings)
    assert "anchored" in result.depths


def test_more_than_64_spots_are_refused() -> None:
    capture = simulated(()).capture
    with pytest.raises(InputError, match=r"has 65 spots; allowed: 1\.\.64"):
        with_spots(capture, [0] * 65)


@pytest.mark.parametrize(
    ("responsivity", "hint"), [(95.0, "gain of 100, divide by that, 0.95"), (1.3, None)]
)
def test_a_responsivity_at_gain_gets_a_hint(responsivity: float, hint: str | None) -> None:
    text = PAPER.replace("responsivity_a_per_w: 0.95", f"responsivity_a_per_w: {responsivity}", 1)
    with pytest.raises(InputError, match="more than one electron per photon") as caught:
        parse_model(text, Instrument, "mine.yaml")
    assert (hint or "") in str(caught.value)
    assert ("gain" in str(caught.value)) == (hint is not None)


def test_all_errors_of_a_file_are_told_at_once() -> None:
    text = (
        PAPER.replace("power_w: 6.4", "power_w: -6.4")
        .replace("fov_deg: 20", "fov_dg: 20")
        .replace("[14.9896229e+6]", "[15.0]")
        .replace("periods: 128000", "periods: many")
    )
    with pytest.raises(InputError) as caught:
        parse_model(text, Instrument, "mine.yaml")
    message = str(caught.value)
    assert message.startswith("mine.yaml: 4 errors: (1) ")
    for part in ("power_w", "'fov_deg'", "15e+6", "tof.periods"):
        assert part in message
    assert "fov_deg: is missing" not in message


def test_all_parts_that_do_not_fit_are_told_at_once() -> None:
    text = PAPER.replace("[1544, 1556]", "[1520, 1530]").replace("patterns: 127", "patterns: 5000")
    with pytest.raises(InputError, match=r"2 errors: \(1\) wavelength_nm.* \(2\) plan: "):
        parse_model(text, Instrument, "mine.yaml")


@pytest.mark.parametrize("missing", [IMAGING, RANGING])
def test_frames_of_a_served_rig_of_one_side(missing: tuple[str, ...]) -> None:
    scene, instrument = load_scene("target-plane"), without(*missing)
    light = surrogate(scene, instrument, seed=0)
    lattice = Lattice(lambda node: light, 1)
    frame, mean = record_frames(
        scene,
        instrument,
        lattice.light(np.zeros((instrument.pattern_plan.exposures, 1))),
        [],
        np.random.SeedSequence(0),
    )
    assert len(frame) == 1
    assert (frame.spots is None) == (missing == RANGING)
    assert mean.image[0].shape == instrument.pattern_plan.shape


@pytest.mark.parametrize("missing", [IMAGING, RANGING])
def test_weather_of_drops_falls_around_one_side(missing: tuple[str, ...]) -> None:
    scene = load_scene("target-plane", {"rain": {"rate_mm_per_h": 30}})
    capture = simulate(scene, without(*missing), light="surrogate").capture
    assert np.isfinite(reconstruct(capture).image).all()
