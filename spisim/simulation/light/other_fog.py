"""Light in fog of another extinction, from the paths of a pass through the scene's own.

More or fewer of the same droplets give each path another weight (see
`spisim.transport.engine.path_weights`), and sums of weighted light, recorded beside the light, are
unbiased estimates of the light in that fog. The effective fraction of the paths that carry such an
estimate, (Σ v w)² / (Σ v Σ v w²) for light v of weights w, says how far it can go: it is 1 if all
weights are equal, and falls as few paths get large weights (A. Kong, J. Am. Stat. Assoc. 89, 278
(1994)).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene import Scene
from spisim.transport.engine.path_weights import ExtinctionRatio
from spisim.transport.engine.sampling import ErrorMetric, Estimate

#: Minimum fraction of the paths that carry an estimate: its error is twice that of all of them.
MIN_CARRIED = 0.25
#: Error in another fog over that in the traced one up to which more paths pay: twice as many.
PAYING_ERROR = np.sqrt(2)
#: Pixels whose paths are counted together: alone, a pixel may have too few of them.
NEIGHBOURS = 8
#: Cosines at which phase functions are compared.
_COSINES = np.linspace(-1, 1, 65)


@dataclass(frozen=True)
class Reweighted:
    """How light in a fog follows from that traced in another."""

    ratio: float  # of the extinction to that of the traced fog
    carried: float  # effective fraction of the paths, the lesser of image and spots

    @property
    def limit(self) -> float:
        """Ratio up to which about `MIN_CARRIED` of the paths would carry; 1 if unknown.

        If scatterings were Poisson distributed, ln `carried` would fall as (ratio − 1)².
        """
        if not 0 < self.carried < 1:
            return 1.0
        further = np.sqrt(np.log(MIN_CARRIED) / np.log(self.carried))
        return max(0.0, float(1 + (self.ratio - 1) * further))

    def require_carried(self) -> float:
        """`carried`; InputError if fewer than `MIN_CARRIED` of the paths carry the estimate."""
        if self.carried >= MIN_CARRIED:
            return self.carried
        limit = "" if self.limit == 1 else f" (about {self.limit:.2g} times would be in range)"
        raise InputError(
            f"fog of {self.ratio:g} times the extinction is too far from what was traced: "
            f"{self.carried:.0%} of the paths carry the estimate, at least {MIN_CARRIED:.0%} are "
            f"needed{limit}; trace a scene with fog nearer to it"
        )


@dataclass(frozen=True, eq=False)
class OtherFog:
    """The same fog of ``ratio`` times the extinction; `scene` is the scene in it."""

    scene: Scene
    ratio: float
    weights: tuple[ExtinctionRatio, ExtinctionRatio]

    @classmethod
    def of(cls, scene: Scene, ratio: float) -> "OtherFog":
        """Fog of a scene, thicker or thinner.

        Raises InputError as `require_fog_alone`, and unless the ratio is positive and finite.
        """
        require_fog_alone(scene)
        if not 0 < ratio < np.inf:
            raise InputError(f"ratio = {ratio:g}: must be positive and finite")
        air = scene.atmosphere
        visibility_m, water = air.visibility_m, air.water_g_per_m3
        other = replace(
            air,
            extinction_per_m=ratio * air.extinction_per_m,
            visibility_m=None if visibility_m is None else visibility_m / ratio,
            water_g_per_m3=None if water is None else ratio * water,
        )
        return cls._from(scene, replace(scene, atmosphere=other), ratio)

    @classmethod
    def of_visibility(cls, scene: Scene, visibility_m: float) -> "OtherFog":
        """The same droplets, more or fewer; InputError as `of`, and if visibility is unknown."""
        require_fog_alone(scene)
        if (own_m := scene.atmosphere.visibility_m) is None:
            raise InputError(f"visibility_m = {visibility_m:g}: that of the scene's fog is unknown")
        return cls.of(scene, own_m / visibility_m)

    @classmethod
    def between(cls, scene: Scene, other: Scene) -> "OtherFog":
        """The fog of another scene, equal to `scene` but for the number of droplets.

        Raises InputError as `require_fog_alone`, and if droplets or pose are others.
        """
        require_fog_alone(scene)
        require_fog_alone(other)
        if not np.array_equal(scene.drone_pose, other.drone_pose):
            raise InputError(f"scene {other.name!r} is seen from another pose than {scene.name!r}")
        own, its = scene.atmosphere, other.atmosphere
        same_phase = np.array_equal(own.phase.density(_COSINES), its.phase.density(_COSINES))
        if own.albedo != its.albedo or not same_phase:
            raise InputError(
                f"fog {its.kind} scatters otherwise than {own.kind}: paths through one say nothing "
                "of the other"
            )
        return cls._from(scene, other, its.extinction_per_m / own.extinction_per_m)

    @classmethod
    def _from(cls, scene: Scene, other: Scene, ratio: float) -> "OtherFog":
        sigma = scene.atmosphere.extinction_per_m
        name = f"in_{ratio:.6g}_times_the_fog"
        square = ExtinctionRatio(f"{name}_squared", ratio, sigma, power=2)
        return cls(other, ratio, (ExtinctionRatio(name, ratio, sigma), square))

    @property
    def ending(self) -> str:
        """Ending of the names of its sums."""
        return f"_{self.weights[0].name}"

    def sums(self, sums: Mapping[str, Floats]) -> dict[str, Floats]:
        """Sums of the light in this fog, by the names that they would have had in a pass."""
        end = self.ending
        return {name[: -len(end)]: each for name, each in sums.items() if name.endswith(end)}

    def carried_image(self, sums: Mapping[str, Floats]) -> float:
        """Effective fraction of the paths of an `image` (pixels,).

        It is the mean over groups of neighbouring pixels, harmonic and weighted by their light in
        this fog: what pixels that see other ranges gain or lose is no uncertainty. 0 if weights are
        too large to sum.
        """
        starts = np.arange(0, len(sums["image"]), NEIGHBOURS)
        light, fraction = self._carried(
            sums, "image", lambda pixels: np.add.reduceat(pixels, starts)
        )
        return float(np.nan_to_num(light.sum() / (light / fraction).sum())) if len(light) else 1.0

    def carried_spots(self, sums: Mapping[str, Floats]) -> float:
        """Effective fraction of the paths of the spot of `histogram` with the least of it."""
        _, fraction = self._carried(sums, "histogram", lambda bins: bins.sum(axis=-1))
        return float(np.nan_to_num(fraction).min(initial=1.0))

    def _carried(
        self, sums: Mapping[str, Floats], name: str, grouped: Callable[[Floats], Floats]
    ) -> tuple[Floats, Floats]:
        """Light in this fog and effective fraction of paths, of groups that are not dark."""
        endings = ("", *(f"_{weight.name}" for weight in self.weights))
        plain, first, second = (grouped(sums[f"{name}{ending}"]) for ending in endings)
        lit = (plain > 0) & ~(first <= 0)
        return first[lit], first[lit] ** 2 / (plain[lit] * second[lit])


def over_fogs(metrics: Sequence[ErrorMetric], others: Sequence[OtherFog]) -> ErrorMetric:
    """Errors of one pass in its own fog and in others: the largest for which more paths pay.

    A fog whose error is more than `PAYING_ERROR` times that in the traced one does not count: a
    pass through it costs less than what this one would have to go on. Readings are those of all
    fogs, one after the other, of the `metrics` of each.
    """
    if not others:
        return metrics[0]

    def readings(sums: Mapping[str, Floats]) -> Floats:
        every = (sums, *(other.sums(sums) for other in others))
        return np.stack([each.readings(own) for each, own in zip(metrics, every, strict=True)])

    def size(mean: Floats, error: Floats) -> float:
        own, *rest = (
            metric.size(*each) for metric, *each in zip(metrics, mean, error, strict=True)
        )
        return max([own, *(each for each in rest if each <= PAYING_ERROR * own)])

    return ErrorMetric(readings, size)


def in_each(
    result: Estimate, metrics: Sequence[ErrorMetric], others: Sequence[OtherFog]
) -> list[Estimate]:
    """Estimates in the fog of a pass and in others, from one with the metric of `over_fogs`."""
    if not others:
        return [result]
    sizes = [metric.size(*each) for metric, *each in zip(metrics, *result.readings, strict=True)]
    return [
        replace(result, size=sizes[0]),
        *(
            replace(result, mean=other.sums(result.mean), error=other.sums(result.error), size=size)
            for other, size in zip(others, sizes[1:], strict=True)
        ),
    ]


def require_fog_alone(scene: Scene) -> None:
    """InputError unless a scene's medium is fog, alone and everywhere."""
    fog = scene.atmosphere
    if not fog.extinction_per_m > 0:
        raise InputError("the air is clear: without fog nothing depends on it")
    if fog.parts or scene.volumes or scene.precipitation:
        raise InputError(
            "the weight of a path in another fog follows only where fog is alone and everywhere: "
            "remove other weather and volumes"
        )
