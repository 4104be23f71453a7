"""`spisim budget`: what an instrument can do, in closed form."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import complete
from .console import print_json, results, say, warn
from .inputs import instrument_with
from .options import Json, Overwrite, Wavelength, real_option
from .outputs import files_read
from .outputs import output as named
from .tables import plain_table, print_table

if TYPE_CHECKING:
    from spisim.atmosphere import Atmosphere
    from spisim.budget import ImageBudget, Target
    from spisim.instrument import Instrument

EXAMPLE = "spisim budget fga015 --range 4 --illuminance 20 -o budget.png"

#: The paper's goal for the scatter of ranges.
LIMIT_M = 0.01
CAVEAT = "An engineering check, no certification: that takes the standards and measurements."


def command(
    instrument: Annotated[
        str,
        typer.Argument(
            metavar="INSTRUMENT",
            help="An instrument file, or a preset's name.",
            autocompletion=complete.instruments,
        ),
    ] = "paper",
    wavelength: Wavelength = None,
    distance: Annotated[
        float, real_option("Of the target.", "--range", minimum=0.01, maximum=1e4, metavar="M")
    ] = 5.0,
    reflectance: Annotated[float, real_option("Of the target.", minimum=0.001, maximum=1)] = 0.5,
    illuminance: Annotated[
        float, real_option("Daylight on the target.", minimum=0, maximum=200, metavar="KLX")
    ] = 100.0,
    visibility: Annotated[
        float | None, real_option("Fog of this visibility; clear without.", metavar="M")
    ] = None,
    correlation: Annotated[
        float | None,
        real_option(
            "Of the image, for which to average frames; 0.9 of the best without.",
            minimum=0.01,
            maximum=0.99,
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="PNG", help="Picture to draw.")
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Light, noise, range and eye safety of an instrument that faces a flat wall."""
    from reconstruction.base.files import require_outputs, write_atomically
    from spisim.atmosphere import CLEAR, fog
    from spisim.budget import Target, budget_warnings

    if output is not None:
        files = [named(output, "budget")]
        require_outputs(files, files_read(instrument), overwrite=overwrite)
    carried = instrument_with(instrument, wavelength)
    air = CLEAR
    if visibility is not None:
        air = fog(visibility, "moderate-radiation", wavelength_nm=carried.wavelength_nm)
    target = Target(distance, reflectance, illuminance, air.extinction_per_m)
    figures = summarise(carried, target, air, correlation)
    warn(warnings := budget_warnings(carried, target))
    if output is not None:
        from spisim.budget.plots import budget_figure
        from spisim.report.style import drawn, file_of, plot_style

        with plot_style():
            figure = budget_figure(carried, target, drawn(Path(instrument).stem), LIMIT_M)
            write_atomically(output, file_of(figure, "budget", dpi=110))
    if json:
        print_json({"instrument": instrument, **figures, "warnings": warnings, "written": output})
        return
    _print(figures)
    if output is not None:
        say(f"Wrote {output}.")


def summarise(
    instrument: Instrument, target: Target, air: Atmosphere, correlation: float | None = None
) -> dict[str, Any]:
    """Everything about one target as plain numbers; spots are the mean of all, σ the worst.

    What an instrument lacks is None.

    `correlation` is that of an image with the truth for which frames are to be averaged.
    """
    from spisim.budget import fog_budget

    in_fog = air.extinction_per_m and instrument.ranges
    return {
        "target": vars(target),
        "image": _image(instrument, target, correlation) if instrument.images else None,
        "spots": _spots(instrument, target) if instrument.ranges else None,
        "range": _range(instrument, target) if instrument.ranges else None,
        "fog": vars(fog_budget(instrument, target, air, LIMIT_M)) if in_fog else None,
        "eye_safety": _safety(instrument),
    }


def _image(instrument: Instrument, target: Target, correlation: float | None) -> dict[str, Any]:
    from spisim.budget import bucket_link, bucket_noise, image_budget

    bucket = bucket_link(instrument, target)
    return {
        "emitted_w": bucket.emitted_w,
        "irradiance_w_per_m2": float(bucket.irradiance_w_per_m2),
        "signal_w": float(bucket.signal_w),
        "daylight_w": float(bucket.daylight_w),
        **_noise(bucket_noise(instrument, bucket)),
        **_picture(image_budget(instrument, target), instrument.frame_time_s, correlation),
    }


def _spots(instrument: Instrument, target: Target) -> dict[str, Any]:
    from spisim.budget import spot_link, spot_noise

    spots = spot_link(instrument, target)
    return {
        "emitted_w": instrument.ranging.lasers.power_w,
        "signal_w": float(spots.echo_w.mean()),
        "daylight_w": float(spots.daylight_w.mean()),
        "patterns_w": float(spots.patterns_w.mean()),
        **_noise(spot_noise(instrument, spots)),
    }


def _range(instrument: Instrument, target: Target) -> dict[str, Any]:
    from spisim.budget import longest_range_m, range_sigma_m

    longest = longest_range_m(
        instrument,
        LIMIT_M,
        reflectance=target.reflectance,
        illuminance_klx=target.illuminance_klx,
        extinction_per_m=float(target.extinction_per_m),
    )
    return {
        "method": instrument.ranging.tof.method,
        "spots": instrument.ranging.spots,
        "frame_time_s": instrument.ranging.frame_time_s,
        "sigma_m": float(range_sigma_m(instrument, target).max()),
        "limit_m": LIMIT_M,
        "longest_m": float(longest),
        "unambiguous_m": instrument.ranging.tof.unambiguous_range_m,
    }


def _noise(budget: Any) -> dict[str, Any]:
    source, fraction = budget.dominating
    return {
        "signal_electrons": float(budget.signal_electrons.mean()),
        "noise_electrons": {
            name: float(variance.mean() ** 0.5) for name, variance in budget.variances.items()
        },
        "total_noise_electrons": float((budget.total_electrons**2).mean() ** 0.5),
        "snr": float(budget.snr.mean()),
        "dominating": {"source": source, "share_of_variance": fraction},
    }


def _picture(budget: ImageBudget, frame_time_s: float, correlation: float | None) -> dict[str, Any]:
    from spisim.budget.image import NEARLY_ALL

    frames = budget.frames(correlation)
    wanted = NEARLY_ALL * budget.best_correlation if correlation is None else correlation
    averaged = wanted if frames is None else budget.averaged_correlation(frames)
    return {
        "pixel_electrons": budget.pixel_electrons,
        "coefficient_noise_electrons": budget.coefficient_noise_electrons,
        "coefficient_snr": budget.coefficient_snr,
        "pixel_noise_electrons": budget.pixel_noise_electrons,
        "pixel_snr": budget.pixel_snr,
        "correlation": budget.correlation,
        "best_correlation": budget.best_correlation,
        "frames_to_average": frames,
        "averaging_time_s": None if frames is None else frames * frame_time_s,
        "averaged_correlation": averaged,
        "gratings": {
            name: {
                "cycles": each.cycles.tolist(),
                "mtf": each.mtf.tolist(),
                "contrast": [float(value) if isfinite(value) else None for value in each.contrast],
                "half_cycles": each.half_cycles if isfinite(each.half_cycles) else None,
            }
            for name, each in (("across", budget.across), ("down", budget.down))
        },
    }


def _safety(instrument: Instrument) -> dict[str, Any]:
    from spisim.budget import array_risk_group, laser_safety

    declared = instrument.eye_safety
    lasers = array = None
    if instrument.ranges:
        lasers = {**vars(laser_safety(instrument)), "declared": declared.laser_class}
    if instrument.images:
        array = {**vars(array_risk_group(instrument)), "declared": declared.risk_group}
    return {"lasers": lasers, "array": array, "caveat": CAVEAT}


def _print(figures: dict[str, Any]) -> None:
    target, image, spots = figures["target"], figures["image"], figures["spots"]
    fog = target["extinction_per_m"]
    air = f"fog that takes {fog:.3g} per metre" if fog else "clear air"
    results.print(
        f"A wall of reflectance {target['reflectance']:g} at {target['distance_m']:g} m, "
        f"{target['illuminance_klx']:g} klx of daylight, {air}\n",
        soft_wrap=True,
    )
    sides = {
        title: side for title, side in (("image", image), ("each spot", spots)) if side is not None
    }
    _print_light(sides)
    _print_noise(sides)
    if image is not None:
        _print_picture(image)
    if figures["range"] is not None:
        _print_range(figures["range"], figures["fog"])
    _print_safety(figures["eye_safety"])


def _print_light(sides: dict[str, dict[str, Any]]) -> None:
    table = plain_table("light, in the filter's band", *sides)
    rows = {
        "emitted, W": "emitted_w",
        "on the wall, W/m²": "irradiance_w_per_m2",
        "back on the aperture, W": "signal_w",
        "of daylight, W": "daylight_w",
        "of the patterns, W": "patterns_w",
        "signal, electrons": "signal_electrons",
    }
    for title, key in rows.items():
        if any(key in side for side in sides.values()):
            table.add_row(title, *(_short(side.get(key)) for side in sides.values()))
    print_table(table)
    readings = {
        "image": "one exposure with all pixels on (image)",
        "each spot": "a tap, window or echo (spots)",
    }
    words = "; ".join(readings[title] for title in sides)
    results.print(f"A reading is {words}.\n", style="dim", soft_wrap=True)


def _print_noise(sides: dict[str, dict[str, Any]]) -> None:
    table = plain_table("noise, electrons rms", *sides)
    sources = dict.fromkeys(
        source for side in reversed(sides.values()) for source in side["noise_electrons"]
    )
    for source in sources:
        table.add_row(
            source, *(_short(side["noise_electrons"].get(source)) for side in sides.values())
        )
    for title, key in (("together", "total_noise_electrons"), ("signal over noise", "snr")):
        table.add_row(title, *(_short(side[key]) for side in sides.values()))
    print_table(table)
    names = {"image": "Image", "each spot": "Spots"}
    for title, side in sides.items():
        maximum = side["dominating"]
        fraction = 100 * maximum["share_of_variance"]
        words = f"the noise of the {maximum['source']} dominates, {fraction:.0f} % of the variance."
        results.print(f"{names[title]}: {words}")
    results.print()


def _print_picture(image: dict[str, Any]) -> None:
    table = plain_table("image of one frame", "value")
    across, down = image["gratings"]["across"], image["gratings"]["down"]
    frames, time_s = image["frames_to_average"], image["averaging_time_s"]
    averaged = "none are enough" if frames is None else f"{frames} ({_short(1e3 * time_s)} ms)"
    rows = [
        ("a pixel, electrons", _short(image["pixel_electrons"])),
        ("noise of a coefficient, electrons", _short(image["coefficient_noise_electrons"])),
        ("signal over noise of a coefficient", _short(image["coefficient_snr"])),
        ("signal over noise of a pixel, zero-filled", _short(image["pixel_snr"])),
        (
            "correlation, zero-filled (without noise)",
            f"{image['correlation']:.2f} ({image['best_correlation']:.2f})",
        ),
        (f"frames to average for {image['averaged_correlation']:.2f}", averaged),
        ("faintest grating seen, contrast", _contrast(across["contrast"][0])),
        (
            "MTF one half, cycles across and down",
            f"{_cycles(across['half_cycles'])} and {_cycles(down['half_cycles'])}",
        ),
    ]
    for row in rows:
        table.add_row(*row)
    print_table(table)
    results.print(
        "Of an image as bright as the wall, with the contrast and spectrum of drawn scenes.\n",
        style="dim",
        soft_wrap=True,
    )


def _contrast(value: float | None) -> str:
    return "none" if value is None or value > 1 else f"{100 * value:.2g} %"


def _cycles(value: float | None) -> str:
    return "beyond all" if value is None else _short(value)


def _print_range(ranges: dict[str, Any], fog: dict[str, Any] | None) -> None:
    """With a column of what a fit of wall and fog together may reach, where there is fog."""
    table = plain_table("range", ranges["method"], *(["fog and wall fitted"] if fog else []))
    goal = f"longest with less than {100 * ranges['limit_m']:g} cm, m"
    rows = [
        ("standard deviation, cm", _centimetres(ranges["sigma_m"])),
        (goal, _short(ranges["longest_m"]) if ranges["longest_m"] else "none"),
        ("unambiguous up to, m", _short(ranges["unambiguous_m"])),
        ("time of a frame, ms", _short(1e3 * ranges["frame_time_s"])),
    ]
    fitted: list[tuple[str, ...]] = [()] * len(rows)
    if fog is not None:
        longest = "none" if fog["longest_m"] == 0 else _short(fog["longest_m"])
        rows.insert(0, ("bias by the echo of fog, cm", _bias(fog["plain_bias_m"])))
        fitted = [("none",), (_centimetres(fog["sigma_m"]),), (longest,), ("",), ("",)]
    for row, more in zip(rows, fitted, strict=True):
        table.add_row(*row, *more)
    print_table(table)
    if fog is not None:
        results.print(
            f"Of a laser's light on its detector {100 * fog['echo_fraction']:.2g} % is the fog's. "
            "Fitted: the Cramér-Rao bound, echo and fog unknown.",
            soft_wrap=True,
        )
    results.print()


def _print_safety(safety: dict[str, Any]) -> None:
    lasers, array = safety["lasers"], safety["array"]
    table = plain_table("eye safety", "value", "of the limit", "result", "declared")
    if lasers is not None:
        mean, pulse = 100 * lasers["mean_margin"], 100 * lasers["pulse_margin"]
        table.add_row(
            f"lasers, mean of {lasers['beams']}, W",
            _short(lasers["mean_w"]),
            f"{mean:.3g} %",
            f"class {lasers['laser_class']}",
            _declared("class", lasers["declared"]),
        )
        table.add_row("lasers, one pulse, J", _short(lasers["pulse_j"]), f"{pulse:.2g} %", "", "")
    if array is not None:
        _add_array(table, array)
    print_table(table)
    results.print(
        "Limits: class 1 of IEC 60825-1, and the exempt group of IEC 62471 (all day long). "
        + safety["caveat"],
        style="dim",
        soft_wrap=True,
    )


def _add_array(table: Any, array: dict[str, Any]) -> None:
    table.add_row(
        "array at 0.2 m, W/m²",
        _short(array["irradiance_w_per_m2"]),
        f"{100 * array['margin']:.0f} %",
        "exempt" if array["risk_group"] == "exempt" else f"risk group {array['risk_group']}",
        _declared("risk group", array["declared"]),
    )
    if array["retinal_margin"]:
        margin = f"{100 * array['retinal_margin']:.0f} %"
        table.add_row("array, on the retina", "", margin, "", "")


def _declared(what: str, value: str | None) -> str:
    return "–" if value is None else f"{what} {value}"


def _bias(value_m: float | None) -> str:
    return "no range" if value_m is None else _centimetres(value_m)


def _centimetres(value_m: float | None) -> str:
    return _short(None if value_m is None else 100 * value_m)


def _short(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
