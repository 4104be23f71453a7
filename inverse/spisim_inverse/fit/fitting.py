"""Maximum likelihood of a twin's parameters, by a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from reconstruction import Capture
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light import LightSequence
from spisim.simulation.measurement import record
from spisim.transport import ground_truth
from spisim_compare.gaussian import Covariance
from spisim_compare.same import check_comparable
from spisim_inverse.fit.flight import FRAMES, Frame, frames_of
from spisim_inverse.fit.information import Information
from spisim_inverse.fit.model import Model
from spisim_inverse.fit.parameters import Parameter, parameters
from spisim_inverse.fit.pose import PoseErrors
from spisim_inverse.fit.priors import Prior, check_priors
from spisim_inverse.fit.readings import Readings
from spisim_inverse.fit.result import Fitted
from spisim_inverse.fit.tracing import Tracer
from spisim_inverse.fit.twin import Twin
from spisim_inverse.fit.view import View

FIRST_SPP = 8
"""Paths per pixel of the first steps; a stage has at most so many times those before it."""
GROWTH = 16
STEPS = 25, 6
"""Maximum evaluations of the first stage, and of each of the later ones."""
ROUNDS = 2, 1
"""Times that the weights of these stages follow from what they expect."""
TOLERANCE = 0.05
"""Change of chi-squared that ends a stage: a quarter of a standard deviation."""
TINY = 1e-300
AT_BOUND = 1e-2
"""Distance from a bound, in coordinates relative to its size, that counts as at it."""


def fit(
    capture: Capture,
    scene: Scene,
    instrument: Instrument,
    free: Mapping[str, float | None],
    *,
    priors: Mapping[str, Prior] | None = None,
    spp: int = 128,
    seed: int = 0,
    frames: int = FRAMES,
    progress: Callable[[float], None] | None = None,
) -> Fitted:
    """Fit parameters of scene, instrument and calibration to a recording.

    Readings are normal with the variance that the model expects (Poisson's and the electronics'),
    whose score equations are those of the Poisson distribution; the error of the traced light
    counts as noise, and steady light as unknown within a third.

    Parameters
    ----------
    capture
        The recording. Of a drone at rest, the means over its frames are fitted; of a flight, some
        frames, each in its pose.
    scene, instrument
        Models of what was recorded; see `spisim.load_scene` and `spisim.load_instrument`.
    free
        Names of the free parameters, each with its start; None is the models' own value.
    priors
        Normal distributions of some of them.
    spp
        Light paths per pixel of the last steps; the first take fewer.
    seed
        Equal seeds give equal results on the same machine.
    frames
        Maximum number of frames of a flight.
    progress
        Called with the completed fraction.

    Returns
    -------
    Fitted
        Estimates, covariance and goodness of fit.

    Raises
    ------
    InputError
        For unknown parameters, starts and priors that are not possible, a capture of another
        instrument, parameters that cannot be distinguished, and if nothing is left to fit.
    """
    views = frames_of(capture, scene, frames)
    twins = [Twin.of(each.scene, instrument, each.capture) for each in views]
    chosen = parameters(twins[0], free)
    check_priors(priors or {}, [each.name for each in chosen])
    model = Model([_view(*each, chosen, seed) for each in zip(views, twins, strict=True)])
    start = np.array([each.coordinate(each.start) for each in chosen])
    stages = _stages(spp)
    _check_same_instrument(views[0].capture, model.views[0], start, stages[0])
    search = _Search(model, priors or {}, len(stages), progress)
    search, start, uninformed = search.informed(start, stages[0])
    for number, paths in enumerate(stages):
        for _ in range(ROUNDS[min(number, 1)]):
            start = search.improved(start, paths, STEPS[min(number, 1)], number)
    return search.result(start, stages[-1], uninformed)


def _view(frame: Frame, twin: Twin, chosen: Sequence[Parameter], seed: int) -> View:
    own = seed + frame.number
    readings, pose = Readings.of(frame.capture), PoseErrors(frame.pose_sigma, own)
    return View(readings, twin, chosen, Tracer(own), own, pose, frame.number)


def _stages(spp: int) -> list[int]:
    stages = [spp]
    while stages[0] > 2 * FIRST_SPP:
        stages.insert(0, max(stages[0] // GROWTH, FIRST_SPP))
    return stages


def _check_same_instrument(capture: Capture, view: View, start: Floats, spp: int) -> None:
    twin = view.at(start)
    sequence = LightSequence(np.zeros(1), (view.tracer(twin, view.parameters, spp).light,))
    plans = len(capture.setup.plans)
    simulated = record(
        twin.scene, twin.instrument, sequence, [ground_truth(twin.scene, twin.instrument)],
        seed=0, noise=False, frames=plans,
    )  # fmt: skip
    try:
        check_comparable(capture, simulated)
    except InputError as error:
        text = str(error).replace("REAL", "the capture").replace("SIMULATED", "the instrument")
        raise InputError(f"a capture of another instrument: {text}") from None


@dataclass(frozen=True, eq=False)
class _Search:
    """Steps towards the maximum."""

    model: Model
    priors: Mapping[str, Prior]
    stages: int
    progress: Callable[[float], None] | None

    def informed(self, start: Floats, spp: int) -> tuple[_Search, Floats, list[Parameter]]:
        """The search for what the readings depend on, its start, and what is left out.

        Raises InputError if nothing is left, or parameters cannot be distinguished.
        """
        whole = self._information(start, spp)
        left_out = whole.uninformed
        kept = [each for each in self.model.parameters if each not in left_out]
        if not kept:
            names = ", ".join(each.name for each in left_out)
            raise InputError(f"the recording does not depend on {names}: nothing can be fitted")
        information = whole.only(kept)
        if information.indistinct:
            raise InputError(
                f"the recording does not determine {information.weakest}: condition number "
                f"{information.condition:.2g}; keep one of these parameters, or give a prior"
            )
        some = [number for number, each in enumerate(self.model.parameters) if each in kept]
        search = replace(self, model=self.model.fixed(left_out))
        return search, start[some], left_out

    def improved(self, start: Floats, spp: int, steps: int, stage: int) -> Floats:
        """Coordinates that are likelier, with weights of those at the start."""
        noise = self.model.covariance(start, spp).only(self.model.usable)
        ends = [
            [each.coordinate(max(bound, TINY) if each.positive else bound) for bound in each.bounds]
            for each in self.model.parameters
        ]
        low, high = np.transpose(ends)
        taken = 0

        def residual(coordinates: Floats) -> Floats:
            nonlocal taken
            taken += 1
            if self.progress is not None:
                self.progress((stage + min(taken / steps, 1.0)) / self.stages)
            return self._residual(coordinates, spp, noise)

        def slope(coordinates: Floats) -> Floats:
            return self._slope(coordinates, spp, noise)

        best = least_squares(
            residual,
            np.clip(start, low, high),
            slope,
            (low, high),
            x_scale="jac",
            ftol=TOLERANCE / self.model.mean.size,
            max_nfev=steps,
        )
        return np.asarray(best.x)

    def result(self, coordinates: Floats, spp: int, uninformed: Sequence[Parameter]) -> Fitted:
        """What came out."""
        model = self.model
        used = model.usable
        noise = model.covariance(coordinates, spp).only(used)
        difference = (model.mean - model.expected(coordinates, spp))[used]
        slopes = model.jacobian(coordinates, spp)[used].T * noise.solve(difference)
        information, bound = (
            Information.of(model.parameters, self._slope(coordinates, spp, each))
            for each in (noise, model.noise(coordinates, spp).only(used))
        )
        at_bounds = [each for each, x in zip(model.parameters, coordinates.tolist(), strict=True)
                     if _is_at_bound(each, x)]  # fmt: skip
        return Fitted(
            model=model,
            coordinates=coordinates,
            information=information,
            bound=bound.covariance,
            difference=difference,
            noise=noise,
            scores=_sums(slopes, model.cluster[used]),
            uninformed=[each.name for each in uninformed],
            at_bounds=[each.name for each in at_bounds],
            priors=dict(self.priors),
            spp=spp,
        )

    def _residual(self, coordinates: Floats, spp: int, noise: Covariance) -> Floats:
        difference = self.model.expected(coordinates, spp) - self.model.mean
        return np.concatenate(
            [
                noise.whiten(difference[self.model.usable]),
                self._prior_residual(coordinates),
                self.model.gauge(coordinates)[0],
            ]
        )

    def _slope(self, coordinates: Floats, spp: int, noise: Covariance) -> Floats:
        columns = self.model.jacobian(coordinates, spp)[self.model.usable]
        return np.vstack(
            [
                noise.whiten(columns),
                self._prior_slope(coordinates),
                self.model.gauge(coordinates)[1],
            ]
        )

    def _information(self, coordinates: Floats, spp: int) -> Information:
        noise = self.model.covariance(coordinates, spp).only(self.model.usable)
        return Information.of(self.model.parameters, self._slope(coordinates, spp, noise))

    def _prior_residual(self, coordinates: Floats) -> Floats:
        return np.array(
            [
                (each.value(x) - self.priors[each.name].mean) / self.priors[each.name].sigma
                for each, x in zip(self.model.parameters, coordinates.tolist(), strict=True)
                if each.name in self.priors
            ]
        )

    def _prior_slope(self, coordinates: Floats) -> Floats:
        rows = [
            np.eye(coordinates.size)[number] * each.slope(each.value(float(coordinates[number])))
            / self.priors[each.name].sigma
            for number, each in enumerate(self.model.parameters)
            if each.name in self.priors
        ]  # fmt: skip
        return np.array(rows).reshape(-1, coordinates.size)


def _sums(columns: Floats, group: NDArray[np.intp]) -> Floats:
    """Sums (groups, k) of columns (k, n) over the readings of each group."""
    return np.transpose([np.bincount(group, each) for each in columns])


def _is_at_bound(parameter: Parameter, coordinate: float) -> bool:
    for bound in parameter.bounds:
        if np.isfinite(bound) and not (parameter.positive and bound <= 0):
            edge = parameter.coordinate(bound)
            if abs(coordinate - edge) <= AT_BOUND * max(abs(edge), 1.0):
                return True
    return False
