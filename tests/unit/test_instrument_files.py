"""Instrument files: read, written again, and every mistake told."""

from pathlib import Path

import pytest
import yaml

from instruments import PAPER, load_text
from reconstruction.base.errors import InputError
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.model import PRESETS


def test_text_loads_as_the_same_instrument(paper: Instrument, tmp_path: Path) -> None:
    assert load_text(tmp_path, paper.text) == paper


def test_text_tells_of_changes(paper: Instrument) -> None:
    changed = paper.model_copy(update={"exposure_time_s": 1e-6})
    assert yaml.safe_load(changed.text)["exposure_time_s"] == 1e-6


def test_exposure_defaults_to_the_pattern_period_and_may_be_shorter(tmp_path: Path) -> None:
    assert load_text(tmp_path, PAPER).exposure_time_s == pytest.approx(1 / 15e3)
    assert load_text(tmp_path, PAPER + "exposure_time_s: 50.0e-6\n").exposure_time_s == 50e-6


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        (("power_w: 6.4", "power_w: -6.4"), ["projector.power_w", "greater than 0", "-6.4"]),
        (("power_w: 6.4", "power_w: .nan"), ["projector.power_w", "finite"]),
        (("power_w: 6.4", "power: 6.4"), ["projector", "did you mean 'power_w'"]),
        (("power_w: 6.4", "power_w: on"), ["projector.power_w", "number", "True"]),
        (("fov_deg: 20", "fov_deg: 180"), ["projector.fov_deg", "less than 180"]),
        (("shape: [64, 64]", "shape: [64, 60]"), ["plan", "60"]),
        (("shape: [64, 64]", "shape: [64]"), ["projector.shape[1]", "missing"]),
        (("shape: [64, 64]", "shape: [4096, 4096]"), ["projector.shape", "at most 1048576 pixels"]),
        (("patterns: 127", "patterns: 5000"), ["plan", "5000"]),
        (("patterns: 127", "patterns: 0"), ["plan.patterns", "greater than 0"]),
        (("patterns: 127", "patterns: 1000\n  interleave: 9"), ["plan: interleave 9", "1..4096"]),
        (
            ("patterns: 127", "patterns: 127\n  interleave: 0"),
            ["plan.interleave", "greater than 0"],
        ),
        (("patterns: 127", "patterns: 127\n  common: 1.5"), ["plan.common", "1.5"]),
        (("order: sequency-2d", "order: sequency2d"), ["plan", "sequency-2d"]),
        (("plan:", "plan:\n  basis: hadamart"), ["plan", "did you mean 'hadamard'"]),
        (("plan:", "plan:\n  basis: dense"), ["plan", "basis dense needs patterns_file"]),
        (("plan:", "plan:\n  patterns_file: p.npy"), ["plan", "hadamard has no patterns_file"]),
        (("polarity: single-ended", "polarity: single"), ["plan.polarity", "single-ended"]),
        (
            ("polarity: single-ended", "polarity: signed"),
            ["plan.polarity", "differences of exposures; choose differential or single-ended"],
        ),
        (("[1544, 1556]", "[1556, 1544]"), ["filter.band_nm", "800 to 1600"]),
        (("[1544, 1556]", "[1520, 1530]"), ["wavelength_nm", "band_nm"]),
        (("wavelength_nm: 1550", "wavelength_nm: 905"), ["wavelength_nm", "1544", "905"]),
        (("wavelength_nm: 1550", "wavelength_nm: 532"), ["wavelength_nm", "800", "532"]),
        (("f_number: 0.95", "f_number: 0.4"), ["detector.f_number", "0.5", "0.4"]),
        (("fill_factor: 0.35", "fill_factor: 35"), ["detector.sensor.fill_factor", "35"]),
        (("responsivity_a_per_w: 0.95", "responsivity_a_per_w: 1.3"), ["electron per photon"]),
        (("bits: 16", "bits: 16.5"), ["detector.adc.bits", "16.5"]),
        (("    - [5, -5]\n", ""), ["lasers.directions_deg", "4"]),
        (("[5, -5]", "[5, -95]"), ["lasers.directions_deg[3][1]", "-95"]),
        (("width: 0.25", "width: 1.25"), ["tof.modulation.taps.width", "1.25"]),
        (("periods: 128000", "periods: many"), ["tof.periods", "'many'"]),
        (("pattern_rate_hz: 15.0e+3", "pattern_rate_hz: 0"), ["projector.pattern_rate_hz"]),
    ],
)
def test_mistake_in_a_field(tmp_path: Path, wrong: tuple[str, str], parts: list[str]) -> None:
    text = PAPER.replace(*wrong, 1)
    assert text != PAPER
    with pytest.raises(InputError) as caught:
        load_text(tmp_path, text)
    message = str(caught.value)
    for part in ["mine.yaml", *parts]:
        assert part in message
    assert len(message.splitlines()) == 1


SPAD = (PRESETS / "spad.yaml").read_text(encoding="utf-8")
HYBRID = (PRESETS / "hybrid.yaml").read_text(encoding="utf-8")
MODULATION = "  modulation: {frequencies_hz: [15.0e+6]}\n  pattern_rate_hz"


@pytest.mark.parametrize(
    ("text", "wrong", "parts"),
    [
        (SPAD, ("type: spad ", "type: sapd "), ["tof.detector.sensor", "sapd", "spad"]),
        (SPAD, ("method: dtof", "method: cw"), ["tof"]),
        (SPAD, ("900.0e+3", "950.0e+3"), ["repetition_rate_hz 950000", "at most"]),
        (SPAD, ("detection_efficiency: 0.15", "detection_efficiency: 15"), ["more than 1"]),
        (SPAD, ("bins: 800", "bins: 2"), ["tof.bins", "greater than or equal to 3"]),
        (HYBRID, ("rise_time_s: 1.0e-9", "rise_time_s: 1.0e-7"), ["rise_time_s", "pulse_width_s"]),
        (HYBRID, ("1.2e+6", "5.0e+6"), ["repetition_rate_hz 5e+06", "at most"]),
        (HYBRID, ("  adc:\n    bits: 16", "  adcs:\n    bits: 16"), ["did you mean 'adc'"]),
        (PAPER, ("in_band_fraction: 1.0", "nonuniformity: 0"), ["in_band_fraction or spectrum"]),
        (PAPER, ("f_number: 0.95", "vignetting: 0"), ["f_number or aperture_diameter_mm"]),
        (PAPER, ("    noise_pa", "    coupling: ac\n    noise_pa"), ["low_cut_hz"]),
        (
            PAPER,
            ("  pattern_rate_hz", MODULATION.replace("15.0e+6", "14.0e+3")),
            ["projector.modulation.frequencies_hz", "at least 1.5e+04"],
        ),
        (
            PAPER,
            ("  pattern_rate_hz", MODULATION.replace("]", "], taps: {width: 0.5}")),
            ["projector.modulation.taps", "width 0.25"],
        ),
        (PAPER, ("[14.9896229e+6]", "[15.0e+6, 15.0e+6]"), ["frequencies_hz", "differ"]),
        (PAPER, ("[14.9896229e+6]", "[]"), ["frequencies_hz", "at least 1 items, not 0"]),
        (
            PAPER,
            ("offset_counts: 256    # assumed; keeps", "offset_counts: 65535 # assumed; keeps"),
            ["detector.adc", "offset_counts 65535", "ends at 65535"],
        ),
        (
            PAPER,
            ("  pattern_rate_hz", "  settling_time_s: 1.0e-3\n  pattern_rate_hz"),
            ["projector.settling_time_s 0.001", "at most 1.333e-05"],
        ),
        (
            PAPER,
            ("1 MΩ feedback has 0.13, the amplifier adds some", "\n    bandwidth_hz: 1.0e+4"),
            ["detector.amplifier.bandwidth_hz", "at most 1.333e-05"],
        ),
        (
            HYBRID,
            (
                "a 15 MHz channel (10 kΩ feedback, 3 pF)",
                "\n      coupling: ac\n      low_cut_hz: 100",
            ),
            ["tof", "coupling should be dc", "pulsed"],
        ),
    ],
)
def test_mistake_in_another_instrument(
    tmp_path: Path, text: str, wrong: tuple[str, str], parts: list[str]
) -> None:
    changed = text.replace(*wrong, 1)
    assert changed != text
    with pytest.raises(InputError) as caught:
        load_text(tmp_path, changed)
    message = str(caught.value)
    for part in ["mine.yaml", *parts]:
        assert part in message
    assert len(message.splitlines()) == 1


def test_exposure_longer_than_a_pattern(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"exposure_time_s 0\.001.*pattern_rate_hz"):
        load_text(tmp_path, PAPER + "exposure_time_s: 1.0e-3\n")


def test_missing_part(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"mine\.yaml: tof is missing: lasers and tof make ranges"):
        load_text(tmp_path, PAPER.split("\ntof:")[0])


def test_unknown_preset_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"no instrument 'papre'.*did you mean 'paper'"):
        load_instrument("papre")


@pytest.mark.parametrize(
    ("plan", "index", "signs"),
    [
        ("{index: [0, 5, 3], polarity: single-ended}", [0, 5, 3, 0], [1, 1, 1, -1]),
        ("{index: [5, 3], polarity: differential}", [5, 5, 3, 3], [1, -1, 1, -1]),
        ("{index: [0, 5, 0], polarity: [1, -1, -1]}", [0, 5, 0], [1, -1, -1]),
        # the numbers in this layout are 64 times the sign changes down, plus those along
        ("{index: [0, 1, 64], polarity: [1, 1, -1], layout: walsh-2d}", [0, 32, 2048], [1, 1, -1]),
    ],
)
def test_a_plan_may_tell_its_rows_one_by_one(
    tmp_path: Path, plan: str, index: list[int], signs: list[int]
) -> None:
    before, _, after = PAPER.partition("\nplan:")
    text = f"{before}\nplan: {plan}\n\nfilter:{after.partition(chr(10) + 'filter:')[2]}"
    instrument = load_text(tmp_path, text)
    displayed = instrument.pattern_plan
    assert (displayed.index.tolist(), displayed.polarity.tolist()) == (index, signs)
    again = load_text(tmp_path, instrument.text).pattern_plan  # as a capture holds it
    assert (again.index.tolist(), again.polarity.tolist()) == (index, signs)


def test_patterns_are_dealt_out_to_frames(paper: Instrument, tmp_path: Path) -> None:
    assert len(paper.pattern_plans) == 1
    text = PAPER.replace("patterns: 127", "patterns: 127\n  interleave: 8")
    dealt = load_text(tmp_path, text)
    plans = dealt.pattern_plans
    assert len(plans) == 8
    assert {plan.sampled for plan in plans} == {127}
    assert dealt.frame_time_s == paper.frame_time_s
    displayed = [set(plan.distinct.tolist()) for plan in plans]
    assert len(set.intersection(*displayed)) == 64
    assert len(set.union(*displayed)) == 64 + 8 * 63
    few = load_text(tmp_path, text.replace("interleave: 8", "interleave: 8\n  common: 0"))
    assert len(set.union(*(set(plan.index.tolist()) for plan in few.pattern_plans))) == 1009
