"""Figure 2: maximum range of the single pixel above the noise floor."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import least_squares

from reconstruction.base.arrays import Floats
from spisim.budget.equations import (
    Criterion,
    Flood,
    common_integration_time_s,
    eq2,
    integration_time_s,
    max_range_m,
)
from spisim.instrument import load_instrument
from spisim_paper.checks import COLOURS, REFLECTANCES, Check, Result, Table, percent

#: Distances labelled in the paper's figure, by reflectance.
PAPER_M: Mapping[float, float] = dict(zip(REFLECTANCES, (2.8, 5.0, 8.0), strict=True))
ILLUMINANCE_KLX = 100.0
#: Power and angle: Table 1 and the figure's text disagree, and the angle is half or full.
LIGHTS = ((6.4, 10.0), (6.4, 20.0), (25.6, 10.0), (25.6, 20.0))
#: Noise of an amplifier for windows of some ten nanoseconds; not in the paper.
AMPLIFIER_A_PER_SQRT_HZ = 2e-12

#: Best fit of one integration time if the signal equals a floor independent of the target:
#: distances as √ρ, with the paper's geometric mean.
PHYSICAL_M = (3.28, 5.19, 6.57)
PHYSICAL_TOLERANCE, TOTAL_TOLERANCE = 0.03, 0.02


@dataclass(frozen=True)
class Reading:
    """One interpretation of the figure, and the resulting distances (3,)."""

    meaning: str
    light: str
    max_range_m: Floats
    time: str  # integration time, in words
    spread: float | None  # longest over shortest time of the three reflectances by themselves

    @property
    def deviation(self) -> Floats:
        """Relative deviation (3,) from the paper."""
        return self.max_range_m / np.array(list(PAPER_M.values())) - 1

    @property
    def row(self) -> tuple[str, ...]:
        """A row of the table."""
        cells = (
            f"{z:.2f} ({percent(off)})"
            for z, off in zip(self.max_range_m, self.deviation, strict=True)
        )
        spread = "" if self.spread is None else f"{self.spread:.1f} ×"
        return (self.meaning, self.light, *cells, self.time, spread)


def figure_2() -> Result:
    """Figure 2 by both criteria."""
    flood = paper_flood(*LIGHTS[0])
    physical = _common(flood, "signal", "signal = floor")
    fraction = fit_total_count()
    total = Reading(
        "signal + daylight = floor, fitted", "any", total_count_max_range(*fraction), "–", None
    )
    readings = [
        physical,
        _common(paper_flood(*LIGHTS[3]), "signal", "signal = floor"),
        _anchored(flood),
        _common(_noiseless(flood), "signal", "signal = shot noise of daylight"),
        *(_common(paper_flood(*light), "total", "signal + daylight = floor") for light in LIGHTS),
        total,
    ]
    titles = (f"ρ = {rho:g}: paper {goal:g} m" for rho, goal in PAPER_M.items())
    columns = ("what ends the range", "light", *titles, "T_int", "own T_int")
    tables = [
        Table(
            "Figure 2: distances in metres (deviation from the paper)",
            columns,
            [each.row for each in readings],
        ),
        Table(_words(flood, fraction)),
    ]
    checks = [
        Check(
            "fig2_physical_deviation",
            float(np.abs(physical.max_range_m / PHYSICAL_M - 1).max()),
            PHYSICAL_TOLERANCE,
        ),
        Check("fig2_total_count_deviation", float(np.abs(total.deviation).max()), TOTAL_TOLERANCE),
    ]
    return Result(tables, checks, _figure(flood, fraction))


def paper_flood(power_w: float, half_angle_deg: float) -> Flood:
    """Light and photodiode of Table 1 in full sun."""
    return Flood.of(
        load_instrument("paper"),
        power_w=power_w,
        half_angle_deg=half_angle_deg,
        illuminance_klx=ILLUMINANCE_KLX,
        noise_a_per_sqrt_hz=AMPLIFIER_A_PER_SQRT_HZ,
    )


def total_count_max_range(floor_over_signal: float, daylight_over_signal: float) -> Floats:
    """Distances (3,) where ρ (S / z² + B) equals a floor: 1 / z² = (floor / S) / ρ - B / S."""
    inverse_square = floor_over_signal / np.array(REFLECTANCES) - daylight_over_signal
    return 1 / np.sqrt(inverse_square)


def fit_total_count() -> tuple[float, float]:
    """floor / S and B / S, m⁻², that fit the figure best (least squares of log z)."""
    goals = np.array(list(PAPER_M.values()))

    def deviation(fraction: Floats) -> Floats:
        return np.log(total_count_max_range(fraction[0], fraction[1]) / goals)

    fit = least_squares(deviation, x0=(0.03, 0.01), x_scale=0.01)
    return float(fit.x[0]), float(fit.x[1])


def _common(flood: Flood, criterion: Criterion, meaning: str) -> Reading:
    """The best single integration time for all reflectances."""
    alone = [integration_time_s(flood, rho, goal, criterion) for rho, goal in PAPER_M.items()]
    time_s = common_integration_time_s(flood, PAPER_M, criterion)
    ranges_m = max_range_m(flood, time_s, REFLECTANCES, criterion)
    return Reading(meaning, _light(flood), ranges_m, _nanoseconds(time_s), max(alone) / min(alone))


def _anchored(flood: Flood) -> Reading:
    """The paper's search with the darkest target as goal."""
    darkest = REFLECTANCES[0]
    time_s = integration_time_s(flood, darkest, PAPER_M[darkest], "signal")
    ranges_m = max_range_m(flood, time_s, REFLECTANCES, "signal")
    meaning = f"signal = floor, searched for {PAPER_M[darkest]:g} m at ρ = {darkest:g}"
    return Reading(meaning, _light(flood), ranges_m, _nanoseconds(time_s), None)


def _noiseless(flood: Flood) -> Flood:
    return replace(flood, noise_a_per_sqrt_hz=0.0, dark_per_s=0.0)


def _light(flood: Flood) -> str:
    return f"{flood.power_w:g} W, α = {flood.half_angle_deg:g}°"


def _nanoseconds(time_s: float) -> str:
    return f"{1e9 * time_s:.3g} ns"


def _words(flood: Flood, fraction: tuple[float, float]) -> str:
    ratio = flood.signal_per_s / flood.background_per_s
    times = [
        common_integration_time_s(replace(flood, noise_a_per_sqrt_hz=noise), PAPER_M, "signal")
        for noise in (AMPLIFIER_A_PER_SQRT_HZ, 2.6e-12)
    ]
    return (
        "If a signal falls as z⁻², the range grows as √ρ at most. The figure rises faster, "
        "from ρ = 0.5 to 0.8 as ρ¹. No single T_int gives the paper's distances where the signal "
        "equals the noise; the best one, the first row, is 18 % off. The distances come out if "
        "daylight counts as signal and the floor does not depend on the target: then "
        f"1/z² = {fraction[0]:.5f}/ρ - {fraction[1]:.5f} m⁻², that is "
        f"S/B = {1 / fraction[1]:.1f} m², "
        f"where Table 1 has {ratio:.1f} m² (6.4 W, α = 10°) and the text's 25.6 W "
        f"{4 * ratio:.1f} m². That is no criterion of visibility, and it fits three distances with "
        "two constants. T_int itself cannot be found, as it goes with the noise floor, which the "
        f"paper does not state: an amplifier of 2 pA/√Hz takes {_nanoseconds(times[0])}, one of "
        f"2.6 pA/√Hz {_nanoseconds(times[1])}, as long as the paper's laser pulses. The last "
        "column has the longest T_int over the shortest if each reflectance has its own."
    )


def _figure(flood: Flood, fraction: tuple[float, float]) -> Figure:
    figure = Figure(figsize=(12, 5), layout="constrained")
    left, right = figure.subplots(1, 2)
    distance = np.linspace(1, 10, 300)
    time_s = common_integration_time_s(flood, PAPER_M, "signal")
    rates = flood.signal_per_s / distance**2
    signals = [rho * rates * time_s for rho in REFLECTANCES]
    floors = [float(eq2(flood, time_s, rho)) for rho in REFLECTANCES]
    ranges_m = max_range_m(flood, time_s, REFLECTANCES, "signal")
    _panel(left, distance, signals, floors, ranges_m)
    left.set(
        title=f"signal = noise floor, T_int = {_nanoseconds(time_s)} ({_light(flood)})",
        ylabel="electrons of the signal",
    )
    totals = [rho * (1 / distance**2 + fraction[1]) / fraction[0] for rho in REFLECTANCES]
    _panel(right, distance, totals, [1.0] * 3, total_count_max_range(*fraction))
    right.set(
        title="signal + daylight = noise floor (fitted)", ylabel="electrons, in units of the floor"
    )
    return figure


def _panel(
    axes: Axes, distance: Floats, counts: list[Floats], floors: list[float], ranges_m: Floats
) -> None:
    cases = zip(REFLECTANCES, COLOURS, counts, floors, ranges_m, PAPER_M.values(), strict=True)
    for rho, colour, count, floor, range_m, goal in cases:
        axes.plot(distance, count, color=colour, label=f"ρ = {rho:g}")
        axes.plot(range_m, floor, "o", color=colour)
        axes.axvline(goal, color=colour, lw=1, ls=":")
        axes.annotate(
            f"{range_m:.2f} m\n(paper {goal:g} m)",
            (range_m, floor),
            xytext=(4, -32),
            textcoords="offset points",
            color=colour,
            fontsize=9,
            bbox={"color": "white", "alpha": 0.8, "pad": 1},
        )
    axes.axhline(float(np.mean(floors)), color="0.2", lw=1.2, label="noise floor")
    axes.plot([], [], color="0.4", lw=1, ls=":", label="the paper's distances")
    axes.set(xlabel="distance, m", yscale="log", xlim=(distance[0], distance[-1]))
    axes.grid(alpha=0.25, which="both")
    axes.legend(framealpha=1, edgecolor="white")
