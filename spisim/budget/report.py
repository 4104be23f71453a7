"""The budget of one target as plain numbers, and as tables."""

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any

from spisim.atmosphere import Atmosphere
from spisim.atmosphere.report import ReportTable
from spisim.budget.eye_safety import array_risk_group, laser_safety
from spisim.budget.fog import fog_budget
from spisim.budget.image import GOAL_FRACTION, ImageBudget, image_budget
from spisim.budget.link import Target, bucket_link, spot_link
from spisim.budget.noise import NoiseBudget, bucket_noise, spot_noise
from spisim.budget.ranging import longest_range_m, range_sigma_m
from spisim.instrument import Instrument

#: The paper's goal for the standard deviation of ranges.
LIMIT_M = 0.01
CAVEAT = "An engineering check, no certification: that takes the standards and measurements."


def summarise(
    instrument: Instrument, target: Target, air: Atmosphere, correlation: float | None = None
) -> dict[str, Any]:
    """One target in plain numbers: means over the spots, the worst σ, None for missing parts."""
    in_fog = air.extinction_per_m and instrument.ranges
    return {
        "target": vars(target),
        "image": _image(instrument, target, correlation) if instrument.images else None,
        "spots": _spots(instrument, target) if instrument.ranges else None,
        "range": _range(instrument, target) if instrument.ranges else None,
        "fog": _fog(instrument, target, air) if in_fog else None,
        "eye_safety": _safety(instrument),
    }


def _image(instrument: Instrument, target: Target, correlation: float | None) -> dict[str, Any]:
    bucket = bucket_link(instrument, target)
    return {
        "emitted_w": bucket.emitted_w,
        "irradiance_w_per_m2": float(bucket.irradiance_w_per_m2),
        "signal_w": float(bucket.signal_w),
        "daylight_w": float(bucket.daylight_w),
        **_noise(bucket_noise(instrument, bucket)),
        **_picture(image_budget(instrument, target), instrument.frame_time_s, correlation),
    }


def _fog(instrument: Instrument, target: Target, air: Atmosphere) -> dict[str, Any]:
    figures = vars(fog_budget(instrument, target, air, LIMIT_M))
    return {"echo_share": figures["echo_fraction"]} | {
        name: value for name, value in figures.items() if name != "echo_fraction"
    }


def _spots(instrument: Instrument, target: Target) -> dict[str, Any]:
    spots = spot_link(instrument, target)
    return {
        "emitted_w": instrument.ranging.lasers.power_w,
        "signal_w": float(spots.echo_w.mean()),
        "daylight_w": float(spots.daylight_w.mean()),
        "patterns_w": float(spots.patterns_w.mean()),
        **_noise(spot_noise(instrument, spots)),
    }


def _range(instrument: Instrument, target: Target) -> dict[str, Any]:
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


def _noise(budget: NoiseBudget) -> dict[str, Any]:
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
    frames = budget.frames(correlation)
    wanted = GOAL_FRACTION * budget.best_correlation if correlation is None else correlation
    averaged = wanted if frames is None else budget.averaged_correlation(frames)
    return {
        "pixel_electrons": budget.pixel_electrons,
        "coefficient_noise_electrons": budget.coefficient_noise_electrons,
        "coefficient_snr": budget.coefficient_snr,
        "pixel_noise_electrons": budget.pixel_noise_electrons,
        "pixel_snr": budget.pixel_snr,
        "correlation": budget.correlation,
        "best_correlation": budget.best_correlation,
        "throughput_rms": budget.throughput_rms,
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
    declared = instrument.eye_safety
    lasers = array = None
    if instrument.ranges:
        lasers = {**vars(laser_safety(instrument)), "declared": declared.laser_class}
    if instrument.images:
        array = {**vars(array_risk_group(instrument)), "declared": declared.risk_group}
    return {"lasers": lasers, "array": array, "caveat": CAVEAT}


def headline(figures: Mapping[str, Any]) -> str:
    """The target in one sentence."""
    target = figures["target"]
    fog = target["extinction_per_m"]
    air = f"fog that takes {fog:.3g} per metre" if fog else "clear air"
    return (
        f"A wall of reflectance {target['reflectance']:g} at {target['distance_m']:g} m, "
        f"{target['illuminance_klx']:g} klx of daylight, {air}\n"
    )


def budget_tables(figures: Mapping[str, Any]) -> Iterator[ReportTable]:
    """The tables of `summarise`: light, noise, image, range and eye safety."""
    sides = {"image": figures["image"], "each spot": figures["spots"]}
    sides = {title: side for title, side in sides.items() if side is not None}
    yield _light_table(sides)
    yield _noise_table(sides)
    if figures["image"] is not None:
        yield _image_table(figures["image"])
    if figures["range"] is not None:
        yield _range_table(figures["range"], figures["fog"])
    yield _safety_table(figures["eye_safety"])


def _light_table(sides: Mapping[str, Mapping[str, Any]]) -> ReportTable:
    titles = {
        "emitted, W": "emitted_w",
        "on the wall, W/m²": "irradiance_w_per_m2",
        "back on the aperture, W": "signal_w",
        "of daylight, W": "daylight_w",
        "of the patterns, W": "patterns_w",
        "signal, electrons": "signal_electrons",
    }
    rows = [
        (title, *(_short(side.get(key)) for side in sides.values()))
        for title, key in titles.items()
        if any(key in side for side in sides.values())
    ]
    readings = {
        "image": "one exposure with all pixels on (image)",
        "each spot": "a tap, window or echo (spots)",
    }
    note = f"A reading is {'; '.join(readings[title] for title in sides)}.\n"
    return ReportTable(("light, in the filter's band", *sides), rows, note)


def _noise_table(sides: Mapping[str, Mapping[str, Any]]) -> ReportTable:
    sources = dict.fromkeys(
        source for side in reversed(list(sides.values())) for source in side["noise_electrons"]
    )
    rows = [
        (source, *(_short(side["noise_electrons"].get(source)) for side in sides.values()))
        for source in sources
    ]
    rows += [
        (title, *(_short(side[key]) for side in sides.values()))
        for title, key in (("together", "total_noise_electrons"), ("signal over noise", "snr"))
    ]
    note = ""
    for title, name in {"image": "Image", "each spot": "Spots"}.items():
        if title in sides:
            maximum = sides[title]["dominating"]
            percent = f"{100 * maximum['share_of_variance']:.0f} % of the variance"
            note += f"{name}: the noise of the {maximum['source']} dominates, {percent}.\n"
    return ReportTable(("noise, electrons rms", *sides), rows, note, dim=False)


def _image_table(image: Mapping[str, Any]) -> ReportTable:
    across, down = image["gratings"]["across"], image["gratings"]["down"]
    rms = image["throughput_rms"]
    frames, time_s = image["frames_to_average"], image["averaging_time_s"]
    averaged = "none are enough" if frames is None else f"{frames} ({_short(1e3 * time_s)} ms)"
    correlations = f"{image['correlation']:.2f} ({image['best_correlation']:.2f})"
    rows = [
        ("a pixel, electrons", _short(image["pixel_electrons"])),
        ("noise of a coefficient, electrons", _short(image["coefficient_noise_electrons"])),
        ("signal over noise of a coefficient", _short(image["coefficient_snr"])),
        ("signal over noise of a pixel, zero-filled", _short(image["pixel_snr"])),
        ("correlation, zero-filled (without noise)", correlations),
        *([("unknown throughput of patterns, rms", f"{100 * rms:.2g} %")] if rms else []),
        (f"frames to average for {image['averaged_correlation']:.2f}", averaged),
        ("faintest grating seen, contrast", _contrast(across["contrast"][0])),
        (
            "MTF one half, cycles across and down",
            f"{_cycles(across['half_cycles'])} and {_cycles(down['half_cycles'])}",
        ),
    ]
    note = "For an image as bright as the wall, with the contrast and spectrum of drawn scenes.\n"
    return ReportTable(("image of one frame", "value"), rows, note)


def _contrast(value: float | None) -> str:
    return "none" if value is None or value > 1 else f"{100 * value:.2g} %"


def _cycles(value: float | None) -> str:
    return "beyond all" if value is None else _short(value)


def _range_table(ranges: Mapping[str, Any], fog: Mapping[str, Any] | None) -> ReportTable:
    """In fog with a column for the joint fit of wall and fog."""
    goal = f"longest with less than {100 * ranges['limit_m']:g} cm, m"
    rows: list[tuple[str, ...]] = [
        ("standard deviation, cm", _centimetres(ranges["sigma_m"])),
        (goal, _short(ranges["longest_m"]) if ranges["longest_m"] else "none"),
        ("unambiguous up to, m", _short(ranges["unambiguous_m"])),
        ("time of a frame, ms", _short(1e3 * ranges["frame_time_s"])),
    ]
    if fog is None:
        return ReportTable(("range", ranges["method"]), rows, "")
    bias = "no range" if fog["plain_bias_m"] is None else _centimetres(fog["plain_bias_m"])
    longest = "none" if fog["longest_m"] == 0 else _short(fog["longest_m"])
    rows.insert(0, ("bias by the echo of fog, cm", bias))
    fitted = ("none", _centimetres(fog["sigma_m"]), longest, "", "")
    note = (
        f"Of a laser's light on its detector {100 * fog['echo_share']:.2g} % is the fog's. "
        "Fitted: the Cramér-Rao bound with unknown echo and fog.\n"
    )
    rows = [(*row, more) for row, more in zip(rows, fitted, strict=True)]
    for name in ("reflectance", "extinction"):
        sigma = fog[f"{name}_sigma"]
        rows.append((f"{name}, ln, sigma", "", _short(sigma)))
    return ReportTable(("range", ranges["method"], "fog and wall fitted"), rows, note, dim=False)


def _safety_table(safety: Mapping[str, Any]) -> ReportTable:
    rows = []
    if (lasers := safety["lasers"]) is not None:
        mean, pulse = 100 * lasers["mean_margin"], 100 * lasers["pulse_margin"]
        rows.append(
            (
                f"lasers, mean of {lasers['beams']}, W",
                _short(lasers["mean_w"]),
                f"{mean:.3g} %",
                f"class {lasers['laser_class']}",
                _declared("class", lasers["declared"]),
            )
        )
        rows.append(("lasers, one pulse, J", _short(lasers["pulse_j"]), f"{pulse:.2g} %", "", ""))
    if (array := safety["array"]) is not None:
        group = array["risk_group"]
        rows.append(
            (
                "array at 0.2 m, W/m²",
                _short(array["irradiance_w_per_m2"]),
                f"{100 * array['margin']:.0f} %",
                "exempt" if group == "exempt" else f"risk group {group}",
                _declared("risk group", array["declared"]),
            )
        )
        if array["retinal_margin"]:
            margin = f"{100 * array['retinal_margin']:.0f} %"
            rows.append(("array, on the retina", "", margin, "", ""))
    note = (
        "Limits: class 1 of IEC 60825-1, and the exempt group of IEC 62471 (all day long). "
        + safety["caveat"]
    )
    return ReportTable(("eye safety", "value", "of the limit", "result", "declared"), rows, note)


def _declared(what: str, value: str | None) -> str:
    return "–" if value is None else f"{what} {value}"


def _centimetres(value_m: float | None) -> str:
    return _short(None if value_m is None else 100 * value_m)


def _short(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"
