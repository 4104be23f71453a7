"""Recordings of SPAS, the acquisition software of OpenSpyrit, as in the SPIHIM collection.

``NAME_spectraldata.npz`` holds the readings (exposures, wavelengths), ``NAME_metadata.json`` a list
of objects with a ``class_description``. Patterns 2k and 2k + 1 are the positive and negative parts
of row k of the Kronecker product of two Walsh matrices in sequency order, pixels row-major (G.
Beneti-Martin et al., Opt. Express 31, 15599 (2023)).
"""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, naming
from reconstruction.capture.importers import ProgramRecording, load_array
from reconstruction.operators import PatternPlan, sequency
from reconstruction.operators.bases.hadamard import Hadamard

DATA, METADATA = "_spectraldata.npz", "_metadata.json"
MAX_BYTES = 2**26
MAX_PATTERNS = 2**22
#: A list of whole numbers, as Python writes it; NumPy's integers have their type around them.
WRAPPED = re.compile(r"np\.u?int(?:8|16|32|64)\((\d{1,9})\)")
WHOLE = re.compile(r"\[\s*(?:\d{1,9}(?:\s*,\s*\d{1,9})*)?\s*\]")
DECIMALS = re.compile(r"\[\s*(?:\d{1,6}(?:\.\d{1,9})?(?:\s*,\s*\d{1,6}(?:\.\d{1,9})?)*)?\s*\]")
PATTERNS_GIVEN = ("walsh", "hadamard")


def load_spas(path: Path, band_nm: tuple[float, float] | None = None) -> ProgramRecording:
    """Load ``*_spectraldata.npz`` of SPAS, summed over a band of wavelengths, by default all.

    Its metadata lie beside it. Raises InputError if a file is missing or invalid.
    """
    metadata = path.with_name(path.name.removesuffix(DATA) + METADATA)
    objects = _objects(metadata)
    with naming(metadata):
        acquisition = _object(objects, "Acquisition parameters", "patterns")
        _check_kind(objects, acquisition)
        plan = _plan(acquisition)
        chosen = _band(acquisition.get("wavelengths"), band_nm)
        about = _about(objects, acquisition)
    spectra = load_array(path, "spectral_data")
    with naming(path):
        readings = _readings(spectra, plan, chosen)
    return ProgramRecording(readings, plan, about)


def whole_numbers(value: Any, name: str) -> NDArray[np.int64]:
    """Whole numbers from 0 of a list, or of Python's text of one, which is never evaluated.

    Raises InputError, which names the field, for anything else.
    """
    if isinstance(value, list) and all(type(each) is int for each in value):
        value = json.dumps(value)
    text = WRAPPED.sub(r"\1", value) if isinstance(value, str) else ""
    if not WHOLE.fullmatch(text):
        raise InputError(f"{name} is {_quoted(value)}, must be a list of whole numbers from 0")
    if text.count(",") >= MAX_PATTERNS:
        raise InputError(f"{name} has more than {MAX_PATTERNS} numbers")
    return np.array(re.findall(r"\d+", text), dtype=np.int64)


def _quoted(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return repr(text if len(text) <= 40 else text[:40] + "...")


def _objects(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        raise InputError(f"{path}: no such file; SPAS writes it beside the readings")
    with naming(path):
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"has more than {MAX_BYTES // 2**20} MiB")
        try:
            objects = json.loads(path.read_text("utf-8-sig", "replace"))
        except (ValueError, RecursionError):
            raise InputError("not readable as JSON") from None
        if not isinstance(objects, list) or not all(isinstance(each, dict) for each in objects):
            raise InputError("should hold a list of objects, as SPAS writes it")
        return objects


def _object(objects: list[dict[str, Any]], kind: str, field: str) -> dict[str, Any]:
    for each in objects:
        if each.get("class_description") == kind and field in each:
            return each
    raise InputError(f"has no object of class_description {kind!r} with {field!r}")


def _check_kind(objects: list[dict[str, Any]], acquisition: dict[str, Any]) -> None:
    """Raise InputError for other patterns than those of a full square."""
    prefix = next((each["pattern_prefix"] for each in objects if "pattern_prefix" in each), "")
    if prefix and not str(prefix).lower().startswith(PATTERNS_GIVEN):
        raise InputError(
            f"pattern_prefix is {_quoted(prefix)}; allowed: names that begin with Walsh or Hadamard"
        )
    if str(acquisition.get("mask_index") or "[]").strip("[] "):
        raise InputError("mask_index is not empty: patterns of part of an image are not read")


def _plan(acquisition: dict[str, Any]) -> PatternPlan:
    height, width = (_side(acquisition, f"pattern_dimension_{axis}") for axis in "yx")
    basis = Hadamard((height, width))
    numbers = whole_numbers(acquisition["patterns"], "patterns")
    if numbers.max(initial=0) >= 2 * basis.rows:
        raise InputError(
            f"patterns holds {numbers.max()}, outside 0..{2 * basis.rows - 1} for {height} x "
            f"{width} pixels in two polarities"
        )
    down, along = np.divmod(numbers // 2, width)
    index = np.argsort(sequency(height))[down] * width + np.argsort(sequency(width))[along]
    sign = (1 - 2 * (numbers % 2)).astype(np.int8)
    return PatternPlan(basis.shape, index.astype(np.int32), sign, patterns=basis)


def _side(acquisition: dict[str, Any], name: str) -> int:
    side = acquisition.get(name)
    if type(side) is not int:
        raise InputError(f"{name} is {_quoted(side)}, must be a whole number")
    return side


def _band(wavelengths: Any, band_nm: tuple[float, float] | None) -> NDArray[np.bool_] | None:
    """Mask of the wavelengths within a band; None for all."""
    if band_nm is None:
        return None
    if not isinstance(wavelengths, str) or not DECIMALS.fullmatch(wavelengths):
        raise InputError(f"wavelengths is {_quoted(wavelengths)}, must be a list of numbers")
    given = np.array(re.findall(r"[\d.]+", wavelengths), dtype=np.float64)
    chosen = (given >= band_nm[0]) & (given <= band_nm[1])
    if not chosen.any():
        raise InputError(
            f"no wavelength lies in {band_nm[0]:g}..{band_nm[1]:g} nm; there are "
            f"{given.min(initial=np.inf):g}..{given.max(initial=0):g}"
        )
    return chosen


def _about(objects: list[dict[str, Any]], acquisition: dict[str, Any]) -> dict[str, float]:
    detector = next((each for each in objects if "integration_time_ms" in each), {})
    times_ms = {
        "exposure_time_s": detector.get("integration_time_ms"),
        "pattern_period_s": acquisition.get("mean_spectrometer_acquisition_time_ms"),
    }
    return {
        name: value / 1e3
        for name, value in times_ms.items()
        if isinstance(value, int | float) and 0 < value < np.inf
    }


def _readings(spectra: NDArray[Any], plan: PatternPlan, chosen: NDArray[np.bool_] | None) -> Floats:
    if spectra.ndim != 2 or len(spectra) % plan.exposures:
        raise InputError(
            f"spectral_data has shape {spectra.shape}, the metadata {plan.exposures} patterns"
        )
    if chosen is not None:
        if spectra.shape[1] != chosen.size:
            raise InputError(
                f"spectral_data has {spectra.shape[1]} wavelengths, the metadata {chosen.size}"
            )
        spectra = spectra[:, chosen]
    return np.asarray(spectra.sum(axis=1, dtype=np.float64)).reshape(-1, plan.exposures)


class Spas:
    """Files of SPAS; see `RecordingFormat`."""

    def recognises(self, path: Path) -> bool:
        """Whether a file is named like readings of SPAS."""
        return path.name.endswith(DATA)

    def load(self, path: Path, band_nm: tuple[float, float] | None = None) -> ProgramRecording:
        """See `load_spas`."""
        return load_spas(path, band_nm)


RECORDING = Spas()
