"""Numbers with the prefix of their unit that suits them."""

from base64 import b64decode

import numpy as np
import pytest
from matplotlib.figure import Figure

from spisim_app.report.page import duration, length
from spisim_app.report.pictures import UNKNOWN, Scale, packed
from spisim_app.report.units import Prefix, engineering, prefix_axis, prefix_log


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (7.26e-6, "W", "7.26 µW"),
        (117.2, "Hz", "117 Hz"),
        (15e3, "Hz", "15.0 kHz"),
        (999.9, "Hz", "1.00 kHz"),
        (-0.0421, "m", "−42.1 mm"),
        (0.0, "m", "0 m"),
        (4.52e6, "e⁻", "4.52 Me⁻"),
        (3e-10, "", "300 × 10⁻¹²"),
        (None, "m", "–"),
        (np.nan, "m", "–"),
    ],
)
def test_values_have_the_prefix_that_suits_them(value: float | None, unit: str, words: str) -> None:
    assert engineering(value, unit) == words


def test_lengths_and_times_are_short() -> None:
    assert [length(value) for value in (12.34, 1.0213, 0.266, 0.0021, None)] == [
        *("12.3 m", "1.02 m", "26.6 cm", "2.10 mm", "–"),
    ]
    assert duration(8.533e-3) == "8.533 ms"


def test_numbers_of_a_scale_share_a_prefix_and_stand_apart() -> None:
    fraction = Scale(0.0, 6.1e-10, "gray", "", exponent=1 / 2.2)
    assert fraction.prefix == Prefix(1e-12, "× 10⁻¹²")
    words, positions = zip(*fraction.ticks, strict=True)
    assert all(len(each) <= 4 for each in words)
    assert np.diff(positions).min() >= 11
    assert [words for words, _ in Scale(0.0, 0.8, "gray", "").ticks] == [
        *("0", "0.2", "0.4", "0.6", "0.8"),
    ]
    assert Scale(0.0, 25_000.0, "gray", "electrons").prefix.unit == "× 10³ electrons"


def test_axes_are_written_in_the_prefix_of_their_ends() -> None:
    axes = Figure().subplots()
    axes.set(xlim=(0, 0.004), ylim=(1e-9, 1e-3), yscale="log")
    prefix_axis(axes.xaxis, "range error, m")
    assert axes.get_xlabel() == "range error, mm"
    assert axes.xaxis.get_major_formatter()(0.002) == "2"
    prefix_log(axes.yaxis, "W/m")
    assert axes.yaxis.get_major_formatter()(1e-5) == "10 µW/m"
    prefix_axis(axes.xaxis, "image PSNR, dB")
    assert axes.get_xlabel() == "image PSNR, dB"


def test_maps_are_packed_to_steps_of_what_they_span() -> None:
    reported = packed([[1.0, np.nan], [3.0, 2.0]])
    steps = np.frombuffer(b64decode(str(reported["values"])), "<u2")
    assert steps.tolist()[:3] == [0, UNKNOWN, UNKNOWN - 1]
    assert reported["low"] + reported["step"] * steps[3] == pytest.approx(2.0, abs=1e-4)
    assert packed([[np.nan]])["values"]
    assert packed([[2.0, 2.0]])["step"] == 1.0
