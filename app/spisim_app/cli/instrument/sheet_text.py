"""Commented YAML of an instrument from the answers of a data sheet."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from reconstruction.base.errors import InputError

from .data_sheet import IMAGE, QUESTIONS, RANGES, detector_parts

#: Full scale before the light is known.
UNKNOWN_ELECTRONS = 1e15
#: Distance of the spots' photodiodes from the laser exits.
ASIDE_M = 0.01
#: Windows per pulse, including that of the background and a gap.
PULSED_WINDOWS = 4
#: Bins of a histogram, bin width relative to the pulse, and maximum dead time.
BINS, BINS_PER_PULSE, DEAD_TIME_S = 800, 10, 1e-6
#: Fraction of a pattern period in which the detector integrates.
COLLECTING = 0.9

Answers = Mapping[str, Any]


def instrument_text(
    answers: Answers, full_scale: Mapping[str, float] = MappingProxyType({})
) -> str:
    """Return the YAML of an instrument file.

    `answers` are as of `data_sheet.completed`. `full_scale` gives the primary electrons that fill
    the converters of ``"detector"`` and ``"tof.detector"``; far too many before the light is known.
    Raises InputError if a part is not made for the wavelength.
    """
    center, half = answers["wavelength_nm"], answers["filter_width_nm"] / 2
    blocks = [
        "# Written by `spisim instrument new`. What is assumed is to be checked.",
        f"wavelength_nm: {center:g}{_about('wavelength_nm')}",
        f"filter:\n"
        f"  band_nm: [{center - half:g}, {center + half:g}]\n"
        f"  transmittance: 0.8  # assumed; hard-coated filters have 0.6 to 0.95",
    ]
    if answers["makes"] != RANGES:
        blocks += _image(answers, full_scale.get("detector", UNKNOWN_ELECTRONS))
    if answers["makes"] != IMAGE:
        blocks += _ranges(answers, full_scale.get("tof.detector", UNKNOWN_ELECTRONS))
    return "\n\n".join(blocks) + "\n"


def _image(answers: Answers, full_scale: float) -> list[str]:
    rate_hz, pixels = answers["pattern_rate_hz"], answers["pixels"]
    return [
        f"projector:\n"
        f"  shape: [{pixels}, {pixels}]{_about('pixels')}\n"
        f"  fov_deg: {answers['field_deg']:g}{_about('field_deg')}\n"
        f"  power_w: {_number(answers['array_power_w'])}{_about('array_power_w')}\n"
        f"  spectrum:\n"
        f"    peak_nm: {answers['wavelength_nm']:g}  # assumed: that of the filter\n"
        f"    fwhm_nm: {answers['array_fwhm_nm']:g}{_about('array_fwhm_nm')}\n"
        f"  pattern_rate_hz: {_number(rate_hz)}{_about('pattern_rate_hz')}",
        f"plan:\n"
        f"  patterns: {answers['patterns']}{_about('patterns')}\n"
        f"  order: sequency-2d      # low spatial frequencies first\n"
        f"  polarity: single-ended  # with one dark exposure, no complements",
        f"exposure_time_s: {_number(COLLECTING / rate_hz)}  # assumed: the rest is for settling",
        f"detector:\n"
        f"  positions_m:\n"
        f"    - [0.05, 0.0, 0.0]    # assumed: beside the projector\n"
        f"  field_of_view_deg: {min(1.8 * answers['field_deg'], 170):g}  # assumed: wider than the "
        f"lit field's diagonal\n"
        f"  f_number: 1.2           # assumed\n"
        f"  lens_transmittance: 0.9  # assumed\n"
        + _sensor(answers, "image", full_scale, noise=0.05, bandwidth_hz=10 * rate_hz, indent=2),
    ]


def _ranges(answers: Answers, full_scale: float) -> list[str]:
    directions = _directions(answers["spots"], answers["field_deg"])
    rows = "\n".join(f"    - [{across:.4g}, {up:.4g}]" for across, up in directions)
    time_s = answers.get("frame_time_s") or (answers["patterns"] + 1) / answers["pattern_rate_hz"]
    light, bandwidth_hz = _light(answers, time_s)
    positions = "\n".join(f"      - [{x:.5f}, {y:.5f}, 0.0]" for x, y in map(_aside, directions))
    return [
        f"lasers:\n"
        f"  power_w: {_number(answers['laser_power_w'])}{_about('laser_power_w')}\n"
        f"  divergence_mrad: 0.5    # assumed: collimated\n"
        f"  waist_mm: 0.5           # assumed\n"
        f"  directions_deg:         # assumed: to the right, up\n{rows}",
        f"tof:\n{light}\n"
        f"  detector:\n"
        f"    positions_m:          # assumed: 1 cm from where the lasers leave\n"
        f"{positions}\n"
        f"    field_of_view_deg: 1.2  # assumed: around the spot; the lens follows from the area\n"
        f"    f_number: 1.0         # assumed\n"
        f"    lens_transmittance: 0.95  # assumed: coated\n"
        + _sensor(answers, "range", full_scale, noise=2.0, bandwidth_hz=bandwidth_hz, indent=4),
    ]


def _light(answers: Answers, time_s: float) -> tuple[str, float]:
    """Return fields of the method for this frame time, and the bandwidth that it needs."""
    method = answers["modulation"]
    if method == "cw":
        frequency_hz = answers["frequency_hz"]
        return (
            f"  method: cw\n"
            f"  modulation:\n"
            f"    frequencies_hz: [{_number(frequency_hz)}]{_about('frequency_hz')}\n"
            f"    light: sine           # assumed\n"
            f"    contrast: 0.9         # assumed\n"
            f"  periods: {max(1, round(frequency_hz * time_s))}  # as long as a frame",
            4 * frequency_hz,
        )
    pulse_s = answers["pulse_s"]
    if method == "pulsed":
        rate_hz = 1 / ((PULSED_WINDOWS + 2) * pulse_s)
        return (
            f"  method: pulsed\n"
            f"  pulse_width_s: {_number(pulse_s)}{_about('pulse_s')}\n"
            f"  windows: {PULSED_WINDOWS - 1}  # assumed\n"
            f"  pulses: {max(1, math.floor(rate_hz * time_s))}  # as long as a frame\n"
            f"  repetition_rate_hz: {_number(rate_hz)}  # assumed: windows and a gap fit a period",
            1 / pulse_s,
        )
    bin_s = pulse_s / BINS_PER_PULSE
    rate_hz = 0.9 / (BINS * bin_s + DEAD_TIME_S)
    return (
        f"  method: dtof\n"
        f"  pulse_fwhm_s: {_number(pulse_s)}{_about('pulse_s')}\n"
        f"  pulses: {max(1, math.floor(rate_hz * time_s))}  # as long as a frame\n"
        f"  repetition_rate_hz: {_number(rate_hz)}  # assumed: gate and dead time fit a period\n"
        f"  bin_width_s: {_number(bin_s)}  # assumed: a tenth of the pulse\n"
        f"  bins: {BINS}  # assumed",
        1 / pulse_s,
    )


def _sensor(
    answers: Answers, of: str, full_scale: float, *, noise: float, bandwidth_hz: float, indent: int
) -> str:
    """Return the sensor by part, and amplifier and converter if it integrates charge."""
    name = answers[f"{of}_part"]
    part = detector_parts()[name]
    low, high = part["band_nm"]
    if not low <= answers["wavelength_nm"] <= high:
        raise InputError(
            f"{of}_part {name}: its values are those of {low:g} to {high:g} nm, not of "
            f"wavelength_nm {answers['wavelength_nm']:g}; commands move an instrument to another "
            "wavelength: --wavelength"
        )
    lines = [f"sensor:  # {part['about']}"]
    lines += [f"  {field}: {_number(value)}" for field, value in part["sensor"].items()]
    if part["sensor"]["type"] != "spad":
        lines += [
            "amplifier:",
            f"  noise_pa_per_sqrt_hz: {noise:g}  # assumed",
            f"  bandwidth_hz: {_number(bandwidth_hz)}  # assumed",
            "adc:",
            f"  bits: {answers[f'{of}_adc_bits']}{_about(f'{of}_adc_bits')}",
            f"  full_scale_electrons: {_number(full_scale)}  # a white wall at 1 m in 100 klx",
            f"  offset_counts: {min(256, 2 ** answers[f'{of}_adc_bits'] // 4)}  # assumed",
        ]
    return "\n".join(f"{' ' * indent}{line}" for line in lines)


def _directions(spots: int, field_deg: float) -> list[tuple[float, float]]:
    """Return centres of the field's quarters for four spots, else a ring or straight ahead."""
    if spots == 1:
        return [(0.0, 0.0)]
    if spots == 4:
        quarter = field_deg / 4
        return [(across, up) for up in (quarter, -quarter) for across in (-quarter, quarter)]
    radius = field_deg / 4 * math.sqrt(2)
    turns = [2 * math.pi * (spot + 0.5) / spots for spot in range(spots)]
    return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]


def _aside(direction: tuple[float, float]) -> tuple[float, float]:
    """Return the position of a spot's photodiode; y is down."""
    length = math.hypot(*direction)
    if length == 0:
        return ASIDE_M, 0.0
    return ASIDE_M * direction[0] / length, -ASIDE_M * direction[1] / length


def _about(name: str) -> str:
    """Return the comment on a field with a question."""
    return f"  # {QUESTIONS[name].text}"


def _number(value: Any) -> str:
    """Format a number for YAML 1.1: a decimal point and a signed exponent."""
    if not isinstance(value, float):
        return str(value)
    text = f"{value:.6g}"
    mantissa, e, exponent = text.partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}e{exponent}" if e else text
