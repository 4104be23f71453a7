"""Taps and windows of the spots as vectors, and how echoes and steady light change them."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture import Spots
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.ranging import FogOptics
from reconstruction.ranging.fog.echo_model import EchoModel
from reconstruction.ranging.visibility import BACKSCATTER_PER_SR

from .patterns import Mean, mean_over_frames

Charges = CwSpots | PulsedSpots
UNSURE_MEAN = 0.3
"""Relative error of an echo's mean light, which steady light hides, from its modulation."""


@dataclass(frozen=True, eq=False)
class FogChange:
    """Change of readings (n,) per 1/m more of extinction: of echoes, and by backscattered light.

    The second is that of fog of water droplets; ``extinction_per_m`` is what was there.
    """

    damped: Floats
    backscattered: Floats
    extinction_per_m: float


class ChargeModel:
    """Readings of taps or windows half way between two captures."""

    def __init__(self, real: Charges, simulated: Charges) -> None:
        self.means: tuple[Mean, Mean] = (_mean(real), _mean(simulated))
        self._own = simulated
        shape = len(simulated.directions), simulated.readings.shape[-1]
        self.value = ((self.means[0].value + self.means[1].value) / 2).reshape(shape)
        self.variance = self.means[0].variance + self.means[1].variance
        self.usable = self.means[0].usable & self.means[1].usable
        self.names = names_of_taps(simulated)
        self.spot = np.repeat(np.arange(shape[0]), shape[1])

    @property
    def between(self) -> Spots:
        """A frame of these readings, in electrons."""
        noise = np.sqrt(self.variance.reshape(self.value.shape).mean(axis=0)) / 2
        return replace(
            self._own,
            taps=self.value[None],
            saturated=~self.usable.reshape((1, *self.value.shape)),
            electrons_per_count=1.0,
            offset_counts=0.0,
            noise_electrons=noise if isinstance(self._own, CwSpots) else float(noise.mean()),
            excess_noise_factor=1e-9,  # all noise is in noise_electrons
        )

    @property
    def steady(self) -> Floats:
        """Change (n,) of the readings by the same steady light on all spots."""
        if isinstance(self._own, PulsedSpots):
            return np.ones(self.value.size)
        time_s = np.broadcast_to(self._own.periods, self._own.tap_frequencies_hz.shape)
        time_s = time_s / self._own.tap_frequencies_hz
        return np.tile(time_s / time_s.mean(), len(self.value))

    @property
    def steady_of_spots(self) -> Floats:
        """Steady light (n, spots) of each spot, at most."""
        return self._per_spot([np.abs(self.value - self._modulated)])

    @property
    def echo(self) -> Floats:
        """Readings (n,) of the echoes alone; continuous waves hide their mean in steady light."""
        return np.asarray(self._modulated + self._mean_light).ravel()

    @property
    def echo_of_spots(self) -> Floats:
        """Readings of the echoes as columns (n, spots), each of one spot."""
        return self._per_spot([self._modulated + self._mean_light])

    @property
    def echo_unsure(self) -> Floats:
        """Standard deviation of ``echo`` as columns (n, spots)."""
        return self._per_spot([UNSURE_MEAN * self._mean_light])

    @property
    def elsewhere(self) -> Floats:
        """Changes (n, columns) of a spot that meets something else: another echo, other light."""
        if isinstance(self._own, PulsedSpots):
            return np.hstack([self._per_tap(self._modulated), self.steady_of_spots])
        own, steady = self._own, self._own.steady
        amplitude = np.sqrt(self._modulated**2 @ steady / steady.sum(axis=0)) @ steady.T
        waves = [np.cos(own.phases_rad), np.sin(own.phases_rad)]
        turned = [amplitude * wave * on for wave in waves for on in steady.T]
        return np.hstack([self._per_spot(turned), self.steady_of_spots])

    def _per_spot(self, values: list[Floats]) -> Floats:
        """Values (S, K) as columns (n, S * len(values)), each of one spot."""
        spots = len(self.value)
        columns = np.zeros((spots, self.value.shape[1], spots, len(values)))
        for number, each in enumerate(values):
            columns[np.arange(spots), :, np.arange(spots), number] = each
        return columns.reshape(self.value.size, -1)

    def _per_tap(self, values: Floats) -> Floats:
        return np.diag(values.ravel())

    @property
    def _modulated(self) -> Floats:
        """What of the readings (S, K) only an echo makes."""
        if isinstance(self._own, PulsedSpots):  # the first window sees no echo
            return np.asarray(self.value - self.value[:, :1])
        steady = self._own.steady
        return np.asarray(self.value - self.value @ (steady @ np.linalg.pinv(steady)).T)

    @property
    def _mean_light(self) -> Floats:
        """Mean light (S, K) of the echoes in each reading, from the amplitudes.

        Light of several paths has less amplitude than mean, least at low frequencies.
        """
        if isinstance(self._own, PulsedSpots):
            return np.zeros_like(self.value)
        steady = self._own.steady
        contrast, energy = (
            np.nan_to_num(np.broadcast_to(each, steady.shape[:1]), nan=1.0)
            for each in (self._own.contrasts, self._own.laser_energies_j)
        )
        amplitude = np.sqrt(2 * self._modulated**2 @ steady / steady.sum(axis=0))
        per_joule = amplitude / ((energy * contrast) @ steady / steady.sum(axis=0))
        return np.asarray(per_joule.max(axis=1, keepdims=True) * energy)

    def fog(self, range_m: Floats, fog: FogOptics | None) -> FogChange | None:
        """Change of readings by more fog; None if lasers or detectors are not stated."""
        own = self._own
        finite = np.isfinite(range_m)
        if fog is None or not finite.any() or np.isnan(own.electrons_per_joule):
            return None
        if np.isnan(own.response(np.array([1.0]))).any() or _is_unknown(own):
            return None
        model = EchoModel(
            own,
            lambda path: own.electrons_per_joule * own.response(path),
            float(range_m[finite].max()) + 1,
        )
        log_fog = np.log([max(fog.backscatter_per_m_sr, 1e-9), max(fog.extinction_per_m, 1e-6)])
        damped, backscattered = np.zeros_like(self.value), np.zeros_like(self.value)
        for spot in np.flatnonzero(finite):
            unit = model(int(spot), float(range_m[spot]), 1.0, log_fog)
            target = unit.of_target[:, 1]
            columns = np.column_stack([target, own.steady])
            left = self.value[spot] - unit.of_fog[:, 0]
            reflectance = max(float(np.linalg.lstsq(columns, left, rcond=None)[0][0]), 0.0)
            echo = model(int(spot), float(range_m[spot]), reflectance, log_fog)
            damped[spot] = echo.of_fog[:, 1] / np.exp(log_fog[1])
            backscattered[spot] = BACKSCATTER_PER_SR * echo.of_fog[:, 0] / np.exp(log_fog[0])
        return FogChange(damped.ravel(), backscattered.ravel(), fog.extinction_per_m)


def _is_unknown(spots: Spots) -> bool:
    needed = (
        spots.detector_axes, spots.half_fields_rad, spots.falloffs, spots.aperture_radii_m,
        spots.beam_divergence_rad, spots.beam_waist_m,
    )  # fmt: skip
    return any(bool(np.isnan(each).any()) for each in needed)


def _mean(spots: Charges) -> Mean:
    electrons = spots.electrons(spots.taps)
    variance = np.array([spots.variance(frame) for frame in electrons])
    flat = (len(electrons), -1)
    return mean_over_frames(
        electrons.reshape(flat), variance.reshape(flat), ~spots.saturated.reshape(flat)
    )


def names_of_taps(spots: Charges) -> list[str]:
    """Names of the taps or windows of all spots."""
    word = "tap" if isinstance(spots, CwSpots) else "window"
    count = spots.readings.shape[-1]
    return [
        f"spot {spot}, {word} {k}" for spot in range(len(spots.directions)) for k in range(count)
    ]
