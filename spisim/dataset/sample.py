"""Simulate one sample of a plan, write it, and report the outcome."""

import errno
import resource
import sys
import time
import traceback
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from threading import Lock
from typing import Any
from warnings import catch_warnings, simplefilter, warn

from threadpoolctl import threadpool_limits

from reconstruction import Capture, capture_warnings, read_capture, write_capture
from reconstruction.base.errors import InputError, explain
from reconstruction.base.files import write_atomically
from reconstruction.base.timing import timed
from spisim.base.config import dump_yaml, load_yaml, parse_model
from spisim.base.exr import write_exr
from spisim.dataset.fogs import FogSeries, forget, light_of
from spisim.dataset.folder import Layout, Origin, done, fingerprint
from spisim.dataset.plan import Keep
from spisim.dataset.planned import PlannedSet, Sample
from spisim.dataset.records import COMPILING, NO_SPACE, SHARED, Outcome
from spisim.instrument import Instrument
from spisim.scene import Scene, make_scene
from spisim.scene.load_context import SceneCache
from spisim.simulation import Simulation, simulate, simulate_from
from spisim.simulation.light.files import write_histograms
from spisim.transport.backend import compiling_timed, free_memory, use_threads

_one_at_a_time = Lock()  # catch_warnings acts on the whole process
_cache = SceneCache()


@dataclass(frozen=True)
class Maker:
    """Makes samples of a plan in a folder. It can be pickled."""

    planned: PlannedSet
    folder: Path

    @cached_property
    def series(self) -> FogSeries:
        """Series of samples that share their light."""
        return FogSeries(self.planned)

    def __call__(self, index: int) -> Outcome:
        """Make one sample on one thread.

        Any exception gives a failed outcome with the reason; its traceback goes to the folder
        `errors`. A full disk gives the status NO_SPACE.
        """
        with _one_at_a_time:
            use_threads(1)
            _calculate_on_one_thread()
            _measure_peak_anew()
            began = time.perf_counter()
            try:
                outcome = self._made(index)
            except Exception as error:
                outcome = self._failed(index, error)
            else:
                with suppress(FileNotFoundError):
                    Layout(self.folder).error(index).unlink()
            seconds = time.perf_counter() - began
            free_memory()
            return replace(outcome, seconds=seconds, peak_memory_mb=peak_memory_mb())

    def _made(self, index: int) -> Outcome:
        layout, sample = Layout(self.folder), self.planned.sample(index)
        seconds: dict[str, float] = {}
        with catch_warnings(record=True) as caught:
            simplefilter("always")
            with timed(seconds, "scene"):
                scene, instrument = load(sample)
            plan = self.planned.plan
            path, options = layout.capture(index), {"seed": sample.seed, **plan.sampling_budget}
            with timed(seconds, "simulate"), compiling_timed(seconds, COMPILING):
                visibility_m = None
                if plan.frames == "flight":
                    whole, beside = _flown(sample, scene, instrument, path, options), []
                else:
                    options["frames"] = plan.frames
                    simulation, visibility_m = self._simulated(
                        sample, scene, instrument, options, seconds
                    )
                    whole, beside = simulation.capture, _write_sidecars(path, simulation, plan.keep)
        with timed(seconds, "write"):
            sidecars = {each.suffix: fingerprint(each)["sha256"] for each in beside}
            messages = tuple(dict.fromkeys(str(warning.message) for warning in caught))
            origin = Origin(self.planned.digest, index, sidecars, messages, visibility_m)
            capture = _with_origin(whole, origin, plan.keep)
            write_capture(capture, path)  # last, so that its presence marks a complete sample
        noted = [*messages, *capture_warnings(capture)]
        outcome = done(layout, sample, beside, noted, visibility_m)
        return replace(outcome, stage_seconds=seconds)

    def _simulated(
        self,
        sample: Sample,
        scene: Scene,
        instrument: Instrument,
        options: dict[str, Any],
        seconds: dict[str, float],
    ) -> tuple[Simulation, float | None]:
        """A simulation, and the visibility of the fog whose paths carry its light in a series."""
        series = self.series.of(sample.index)
        if len(series) > 1:
            shared = light_of(self.planned, series, load)
            if shared.is_new:
                seconds[SHARED] = shared.seconds * (1 - 1 / len(series))
            if sample.index in shared.light:
                for each in shared.warnings:
                    warn(each.message, each.category, stacklevel=1)
                light = shared.light[sample.index]
                simulation = simulate_from(scene, instrument, light, **options)
                return simulation, shared.visibility_m[sample.index]
        return simulate(scene, instrument, **options), None

    def _failed(self, index: int, error: Exception) -> Outcome:
        text = "".join(traceback.format_exception(error))
        try:
            if is_out_of_space(error):
                raise error
            write_atomically(Layout(self.folder).error(index), text.encode())
        except OSError as problem:
            if not is_out_of_space(problem):
                raise
            return Outcome(index, NO_SPACE, error=explain(problem))
        scene, parameters = None, {}
        with suppress(InputError):
            sample = self.planned.sample(index)
            scene, parameters = sample.scene_name, dict(sample.parameters)
        return Outcome(index, "failed", scene=scene, parameters=parameters, error=_reason(error))


class WarmMaker(Maker):
    """Makes samples at the speed of a worker that has already loaded and compiled everything."""

    def __call__(self, index: int) -> Outcome:
        """Make one sample; make the first of a process twice and add the compile time of both."""
        if _warm:
            return super().__call__(index)
        _warm.append(index)
        first = super().__call__(index)
        forget()  # or the second would not trace its series
        outcome = super().__call__(index)
        compiling_s = first.compiling_s + outcome.compiling_s
        return replace(
            outcome,
            seconds=(outcome.seconds or 0.0) + first.compiling_s,
            stage_seconds={**outcome.stage_seconds, COMPILING: compiling_s},
        )


_warm: list[int] = []  # the sample that warmed up this process


@cache
def _calculate_on_one_thread() -> None:
    """Limit BLAS to one thread, because its idle threads spin on the cores of other workers."""
    threadpool_limits(1)


def load(sample: Sample) -> tuple[Scene, Instrument]:
    """Load scene and instrument of a sample. Raises InputError."""
    instrument = parse_model(
        dump_yaml(sample.instrument_fields), Instrument, "instrument", sample.instrument_folder
    )
    if sample.wavelength_nm is not None:
        instrument = instrument.at_wavelength(sample.wavelength_nm)
    scene = make_scene(
        dump_yaml(sample.scene_fields),
        sample.scene_folder,
        f"scene {sample.scene_name}",
        wavelength_nm=instrument.wavelength_nm,
        cache=_cache,
    )
    return sample.view.of(scene), instrument


def _flown(
    sample: Sample, scene: Scene, instrument: Instrument, path: Path, options: Mapping[str, Any]
) -> Capture:
    """Every frame of the sample's flight; a worker that is killed leaves its segments."""
    from spisim.simulation.flight import record_flight

    file = path.with_suffix(".flight.h5")
    record_flight(file, scene, sample.view.flight(scene), instrument, **options)
    capture = read_capture(file)
    file.unlink()
    return capture


def _measure_peak_anew() -> None:
    """Reset the kernel's peak memory of this process (Linux only)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_memory_mb() -> float:
    """Return the peak memory of this process, in MiB, since the last reset."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


def is_out_of_space(error: BaseException) -> bool:
    """Return whether an error means a full disk or an exhausted quota."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


def _with_origin(capture: Capture, origin: Origin, keep: Keep) -> Capture:
    """Add the origin of a capture, and remove its time so that equal samples give equal files."""
    settings = load_yaml(capture.provenance.settings, "settings")
    settings["data_set"] = origin.settings
    provenance = replace(capture.provenance, created="", settings=dump_yaml(settings))
    truth = capture.truth if keep.truth else None
    return replace(capture, provenance=provenance, truth=truth)


def _write_sidecars(path: Path, simulation: Simulation, keep: Keep) -> list[Path]:
    written = []
    if keep.transport:
        light = simulation.transport
        channels: dict[str, Any] = {"transport": light.image, "transport_error": light.image_error}
        written.append(path.with_suffix(".exr"))
        write_exr(
            written[-1], "transport image", channels, {f"units.{name}": "1" for name in channels}
        )
    if keep.histograms:
        written.append(path.with_suffix(".npz"))
        write_histograms(written[-1], simulation.transport)
    return written


def _reason(error: Exception) -> str:
    """Describe an error in one line."""
    if isinstance(error, InputError):
        text = str(error)
    elif isinstance(error, OSError):
        text = explain(error)
    else:
        text = f"{type(error).__name__}: {error}"
    return " ".join(text.split())
