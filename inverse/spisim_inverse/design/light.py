"""Light of scenes, traced once for all instruments with the same optics, and kept.

The transport is a fraction of emitted power. It depends on where light leaves and is collected, not
on powers, frequencies, times, patterns or electronics. The projector's light on the ranging
detectors is that of the base's mean pattern, scaled with the mean power.
"""

import hashlib
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from reconstruction.base.errors import InputError
from reconstruction.base.files import write_atomically
from spisim.base.config.distributions import stream
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light import LightSequence, Transport, solve, solve_spots
from spisim.transport import GroundTruth, Outputs, ground_truth
from spisim.version import __version__

SPOT_FACTOR = 16
"""Factor of the paths of spots: they are few, and decide about ranges."""
EXTRA = "extra."
"""Prefix of arrays of `Transport.extra` in files."""
BESIDE = "extra", "reweighted"
"""Fields of `Transport` that are no arrays; light of designs is traced in its own fog."""


@dataclass(frozen=True, eq=False)
class Case:
    """A scene in a weather; scenes of one `world` number differ by weather alone."""

    world: str
    weather: str
    scene: Scene


@dataclass(frozen=True, eq=False)
class Lit:
    """A case in the light of an instrument's optics."""

    case: Case
    light: LightSequence
    truth: GroundTruth


@dataclass(eq=False)
class TracedLight:
    """Light of cases by optics; `folder` keeps it between runs."""

    cases: Sequence[Case]
    folder: Path
    spp: int
    seed: int
    _kept: dict[tuple[int, str], tuple[Transport, GroundTruth]] = field(default_factory=dict)

    def of(self, instrument: Instrument, progress: Callable[[float], None]) -> list[Lit]:
        """All cases in the light of an instrument; only what no instrument before had is traced.

        Raises
        ------
        InputError
            As `spisim.simulation.light.solve`, and for an instrument with mirrors.
        """
        if instrument.lasers is not None and instrument.lasers.steering is not None:
            raise InputError("lasers.steering: a design needs spots at rest")
        lit = []
        for number, case in enumerate(self.cases):
            key = number, optics_of(instrument)
            if key not in self._kept:
                light = self._traced(case, instrument)
                self._kept[key] = light, ground_truth(case.scene, instrument, subpixels=1)
            light, truth = self._kept[key]
            scaled = replace(light, spot_crosstalk_w=light.spot_crosstalk_w * _mean_w(instrument))
            lit.append(Lit(case, LightSequence(np.zeros(1), (scaled,)), truth))
            progress((number + 1) / len(self.cases))
        return lit

    def _traced(self, case: Case, instrument: Instrument) -> Transport:
        whole = self._from_file(
            case,
            optics_of(instrument, directions=False),
            lambda: _per_watt(
                solve(
                    case.scene,
                    instrument,
                    spp=self.spp,
                    seed=self._seed(case, "image"),
                    outputs=Outputs(frequencies_hz=instrument.tap_frequencies_hz),
                ),
                instrument,
            ),
        )
        if instrument.lasers is None:
            return whole
        directions = instrument.ranging.lasers.directions
        return self._from_file(
            case,
            optics_of(instrument),
            lambda: solve_spots(
                case.scene,
                instrument,
                directions,
                whole,
                spp=SPOT_FACTOR * self.spp,
                seed=self._seed(case, "spots"),
            ),
        )

    def _seed(self, case: Case, what: str) -> int:
        return int(stream(self.seed, case.world, case.weather, what).integers(2**31))

    def _from_file(self, case: Case, optics: str, trace: Callable[[], Transport]) -> Transport:
        what = repr((case.scene.text, optics, self.spp, self.seed, __version__))
        path = self.folder / f"{hashlib.sha256(what.encode()).hexdigest()[:24]}.npz"
        if path.exists():
            return _read(path)
        light = trace()
        _write(path, light)
        return light


def optics_of(instrument: Instrument, *, directions: bool = True) -> str:
    """Digest of all that light depends on; without the `directions` of the lasers if asked."""
    parts: list[Any] = [instrument.wavelength_nm, instrument.filter.band_nm]
    if instrument.images:
        projector = instrument.imaging.projector
        parts += [
            *(projector.shape, projector.fov_deg, projector.pixel_fractions.tobytes()),
            *(projector.lens_radius_m, projector.focus_m, instrument.tap_frequencies_hz),
        ]
    for name, detector in instrument.detectors.items():
        parts += [
            *(name, detector.positions_m, detector.field_of_view_deg, detector.vignetting),
            detector.aperture_area_m2,
        ]
    if instrument.lasers is not None:
        lasers = instrument.lasers
        parts += [lasers.divergence_mrad, lasers.waist_mm, len(lasers.directions_deg)]
        parts += [lasers.directions_deg] if directions else []
    parts.append(instrument.zones)
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _mean_w(instrument: Instrument) -> float:
    return float(instrument.mean_powers_w.sum()) if instrument.images else 0.0


def _per_watt(light: Transport, instrument: Instrument) -> Transport:
    """Light whose crosstalk is that of a watt."""
    watt = _mean_w(instrument)
    if watt == 0:
        return light
    return replace(
        light,
        spot_crosstalk_w=light.spot_crosstalk_w / watt,
        spot_crosstalk_error_w=light.spot_crosstalk_error_w / watt,
    )


def _write(path: Path, light: Transport) -> None:
    extra = {f"{EXTRA}{name}": array for name, array in light.extra.items()}
    names = (each.name for each in fields(light) if each.name not in BESIDE)
    own = {name: getattr(light, name) for name in names}
    own = {name: value for name, value in own.items() if value is not None}  # by default none
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **own, **extra)
    write_atomically(path, buffer.getvalue())


def _read(path: Path) -> Transport:
    try:
        with path.open("rb") as file, np.load(file) as kept:
            arrays = {name: kept[name] for name in kept.files}
    except (OSError, ValueError, EOFError, BadZipFile) as error:
        raise InputError(f"{path}: not readable ({error}); remove it") from None
    beside = {name for name in arrays if name.startswith(EXTRA)}
    extra = {name.removeprefix(EXTRA): arrays.pop(name) for name in beside}
    own = {name: array if array.ndim else array.item() for name, array in arrays.items()}
    return Transport(**own, extra=extra)
