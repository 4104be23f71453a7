"""Options of `import` for the readings of the spots."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError, naming
from ..capture import Optics, Spots
from ..capture.importers import (
    TAPS_ABOUT,
    TEXTS,
    SpotGeometry,
    by_spot,
    read_about,
    spots_from_histograms,
    spots_from_taps,
    spots_from_windows,
)
from .numbers import angles, number, whole_number

Source = Callable[[str], NDArray[Any]]
"""Reads numbers of a file, or of a variable or column of the readings' file."""

SPOT = "spot="
"""Before the name of the column that numbers the spots."""
KINDS = ("frequency", "windows", "bin_width")
"""Options that state how the spots were measured."""
CHARGE = ("frequency", "windows")
NEEDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    *((name, ("taps",)) for name in (*KINDS, "directions", "detectors", "columns")),
    ("taps", KINDS),
    ("windows", ("pulse_width",)),
    ("bin_width", ("pulses",)),
    ("phases_deg", ("frequency",)),
    ("phase_offsets_deg", ("frequency",)),
    ("pulse_width", ("windows",)),
    ("pulses", ("windows", "bin_width")),
    ("first_bin", ("bin_width",)),
    ("response_sigma", ("bin_width",)),
    ("delay_offset", ("windows", "bin_width")),
    *((name, CHARGE) for name in ("taps_about", *(f"taps_{about}" for about in TAPS_ABOUT))),
    ("fov_deg", ("directions",)),
    ("fov_deg", ("file",)),
)
"""Options, and those of which each needs one."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of the spots."""
    group = parser.add_argument_group(
        "time of flight of the spots (iToF, pulses, dToF), of four without --directions"
    )
    add = group.add_argument
    add("--taps", metavar="SOURCE", help="taps, windows or histograms of the spots")
    add("--columns", metavar="NAME", nargs="+", help="of the taps in a text; spot=NAME of the spot")
    one_of = group.add_mutually_exclusive_group().add_argument
    many: dict[str, Any] = {"type": number, "nargs": "+"}
    one_of("--frequency", metavar="HZ", **many, help="of modulated light: 20e6")
    one_of("--windows", metavar="S", **many, help="starts of windows, background first")
    one_of("--bin-width", metavar="S", type=number, help="of histograms")
    add("--phases-deg", metavar="DEG", **many, help="of taps (0 90 180 270)")
    add("--phase-offsets-deg", metavar="DEG", **many, help="at zero path, of each frequency (0)")
    add("--pulse-width", metavar="S", type=number, help="as long as the windows are")
    add("--pulses", metavar="N", type=whole_number, help="of a window or histogram")
    add("--first-bin", metavar="S", type=number, help="when histograms begin (0)")
    add("--response-sigma", metavar="S", type=number, help="of pulse and jitter")
    add("--delay-offset", metavar="S", type=number, help="at zero path (0)")
    add(
        "--directions",
        metavar="SOURCE",
        help="from the pinhole to the spots, as many as there are, a line each: x y z",
    )
    add("--detectors", metavar="SOURCE", help="their positions in metres, a line each")
    add("--fov-deg", metavar="WIDTHxHEIGHT", type=angles, help="of the patterns, for depth maps")
    add("--taps-about", metavar="YAML", type=Path, help="file of lines like noise_electrons: 40")
    for name in TAPS_ABOUT:
        add(f"--taps-{name.replace('_', '-')}", metavar="X", type=number)


def spots_of(options: argparse.Namespace, source: Source) -> Spots | None:
    """Readings of the spots by the options; None without ``--taps``."""
    _check_options(options)
    if options.taps is None:
        return None
    geometry = _geometry(options, source)
    taps = source(options.taps) if options.columns is None else _columns(options, source)
    with naming(options.taps):
        return _spots(options, taps, geometry)


def _columns(options: argparse.Namespace, source: Source) -> NDArray[Any]:
    """Taps of the named columns of a text, in the order of their spots if a column has these."""
    if Path(options.taps).suffix.lower() not in TEXTS:
        raise InputError(
            f"--columns needs a text as --taps ({', '.join(TEXTS)}), not {options.taps}"
        )
    names = [name for name in options.columns if not name.startswith(SPOT)]
    spots = [name.removeprefix(SPOT) for name in options.columns if name.startswith(SPOT)]
    if not names or len(spots) > 1:
        raise InputError(
            "--columns must name the columns of the taps, and at most one of the spots as spot=NAME"
        )
    taps, *spot = (
        np.column_stack([np.atleast_1d(source(f"{options.taps}:{name}")) for name in each])
        for each in (names, spots)
        if each
    )
    with naming(options.taps):
        return by_spot(taps, spot[0][:, 0]) if spot else taps


def _spots(options: argparse.Namespace, taps: NDArray[Any], geometry: SpotGeometry) -> Spots:
    delay_offset_s = options.delay_offset or 0.0
    if options.bin_width is not None:
        return spots_from_histograms(
            taps,
            options.bin_width,
            options.pulses,
            start_s=options.first_bin or 0.0,
            response_sigma_s=options.response_sigma or np.nan,
            delay_offset_s=delay_offset_s,
            geometry=geometry,
        )
    about = _about(options)
    if options.windows is not None:
        return spots_from_windows(
            taps,
            options.windows,
            options.pulse_width,
            pulses=options.pulses or 1,
            delay_offset_s=delay_offset_s,
            geometry=geometry,
            about=about,
        )
    offsets_deg = options.phase_offsets_deg or [0.0]
    if len(offsets_deg) not in (1, len(options.frequency)):
        raise InputError(
            f"--phase-offsets-deg has {len(offsets_deg)} numbers, must have one per frequency, "
            f"{len(options.frequency)}"
        )
    return spots_from_taps(
        taps,
        options.frequency,
        phases_rad=np.radians(options.phases_deg or [0, 90, 180, 270]),
        phase_offsets_rad=np.radians(offsets_deg),
        geometry=geometry,
        about=about,
    )


def optics_of(options: argparse.Namespace) -> Optics | None:
    """The projector's angles of view, if stated."""
    if options.fov_deg is None:
        return None
    wide, high = np.tan(np.radians(options.fov_deg) / 2)
    return Optics(tan_half_width=float(wide), tan_half_height=float(high))


def notes_of(options: argparse.Namespace) -> list[str]:
    """Warnings about assumptions."""
    notes = []
    if options.taps is not None and options.directions is None:
        notes.append(
            "the spots' directions are not stated: assumed straight ahead (--directions SOURCE)"
        )
    counted = options.taps is None or options.bin_width is not None
    if not counted and "electrons_per_count" not in _about(options):
        notes.append(
            "electrons_per_count of the taps is not stated: assumed 1, which scales the ranges' "
            "sigma (--taps-electrons-per-count X)"
        )
    return notes


def _geometry(options: argparse.Namespace, source: Source) -> SpotGeometry:
    given = {"directions": options.directions, "detector_positions_m": options.detectors}
    return SpotGeometry(**{name: source(at) for name, at in given.items() if at is not None})


def _about(options: argparse.Namespace) -> dict[str, float]:
    """Detector properties from a file and from options, which take precedence."""
    about = {} if options.taps_about is None else read_about(options.taps_about, TAPS_ABOUT)
    given = {name: getattr(options, f"taps_{name}") for name in TAPS_ABOUT}
    return about | {name: value for name, value in given.items() if value is not None}


def _check_options(options: argparse.Namespace) -> None:
    """Raise InputError for an option without those it needs."""
    for name, others in NEEDS:
        if getattr(options, name) is not None and all(
            getattr(options, other) is None for other in others
        ):
            raise InputError(f"{_option(name)} needs {' or '.join(map(_option, others))}")


def _option(name: str) -> str:
    return "FILE" if name == "file" else f"--{name.replace('_', '-')}"
