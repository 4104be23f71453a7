"""Scores: derivatives of the logarithm of a path's light by parameters, summed along the path.

The light of a path is a product of factors, so its score by a parameter is a sum of what each
factor adds: a reflection off a material adds the fraction of the light that its reflectance scales,
a scattering in a medium 1 to those by extinction and albedo, a stretch of the way minus its optical
depth to that by extinction. All strategies build the same paths, so they agree on their scores.
Nothing is computed for parameters that are not tracked.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, Union

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.scene import Material, SceneObject
from spisim.scene.bsdf import Plastic, Principled, Retroreflector, RoughPlastic
from spisim.transport.jit import Bool, Float, Hit, Object, Ray, Sampler, UInt, Vector
from spisim.transport.media import Media
from spisim.transport.meshes import Meshes

#: By the name of each parameter; those without an entry are 0. Never changed, only replaced.
Scores: TypeAlias = dict[str, Float]
NO_SCORES: Scores = {}


def together(*parts: Scores) -> Scores:
    """Sums of scores."""
    total: Scores = {}
    for part in parts:
        total = total | {name: total.get(name, 0) + each for name, each in part.items()}
    return total


@dataclass(frozen=True)
class Scored:
    """A factor of a path's light, and what it adds to the path's scores."""

    value: Float
    scores: Scores = field(default_factory=dict)

    def __mul__(self, other: Union["Scored", Float]) -> "Scored":
        if isinstance(other, Scored):
            return Scored(self.value * other.value, together(self.scores, other.scores))
        return Scored(self.value * other, self.scores)

    def within(self, lanes: Bool) -> "Scored":
        """The factor in some lanes, 1 in the others."""
        scores = {name: dr.select(lanes, each, 0) for name, each in self.scores.items()}
        return Scored(dr.select(lanes, self.value, 1), scores)


@dataclass(frozen=True)
class Reflectance:
    """Factor on the reflectance of a material, textures included, wherever the scene has it."""

    material: str


@dataclass(frozen=True)
class Extinction:
    """Factor on the extinction of one of the media."""

    medium: int


@dataclass(frozen=True)
class Albedo:
    """Factor on the albedo of one of the media."""

    medium: int


@dataclass(frozen=True)
class Asymmetry:
    """Asymmetry `g` of a medium's Henyey–Greenstein phase function, itself."""

    medium: int
    g: float


Parameter = Reflectance | Extinction | Albedo | Asymmetry


@dataclass(frozen=True, eq=False)
class Tracked:
    """The parameters whose scores are kept, by name, and where paths meet them."""

    parameters: Mapping[str, Parameter]
    media: Media
    surfaces: "_Surfaces | None"

    @classmethod
    def of(
        cls,
        parameters: Mapping[str, Parameter],
        media: Media,
        meshes: Meshes,
        objects: Sequence[SceneObject],
    ) -> "Tracked":
        """Parameters of a world; those of surfaces cost nothing where there are none."""
        materials = {
            name: each.material
            for name, each in parameters.items()
            if isinstance(each, Reflectance)
        }
        surfaces = _Surfaces.of(materials, meshes, objects) if materials else None
        return cls(parameters, media, surfaces)

    @property
    def none(self) -> Scores:
        """Scores of a path that has met nothing."""
        return {name: mi.Float(0) for name in self.parameters}

    def reflected(
        self, context: Object, si: Hit, towards: Vector, value: Float, active: Bool
    ) -> Scores:
        """Of light that a surface scatters `towards` a local direction, BSDF x cosine `value`."""
        if self.surfaces is None:
            return {}
        return self.surfaces.scores(context, si, towards, lambda lit: value, active)

    def sampled(self, context: Object, si: Hit, sample: Object, active: Bool) -> Scores:
        """Of the direction that a surface has drawn."""
        if self.surfaces is None:
            return {}
        delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)

        def value(lit: Bool) -> Float:
            return si.bsdf().eval(context, si, sample.wo, lit & ~delta).x

        active &= ~mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
        return self.surfaces.scores(context, si, sample.wo, value, active)

    def scattered(
        self, fraction: Callable[[int], Float], incoming: Vector, outgoing: Vector
    ) -> Scores:
        """Of light that media scatter, `fraction` of it by each."""
        scores: Scores = {}
        for name, each in self.parameters.items():
            match each:
                case Extinction(medium) | Albedo(medium):
                    scores[name] = fraction(medium)
                case Asymmetry(medium, g):
                    scores[name] = fraction(medium) * _henyey_greenstein(g, incoming, outgoing)
        return scores

    def scattered_by(
        self, medium: UInt, incoming: Vector, outgoing: Vector, active: Bool
    ) -> Scores:
        """Of light that one medium scatters, by its index."""
        return self.scattered(
            lambda number: dr.select(active & (medium == number), mi.Float(1), 0),
            incoming,
            outgoing,
        )

    def along(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Scores:
        """Of the way along a ray."""
        return {
            name: -self.media.parts[each.medium].depth(ray, far, sampler, active)
            for name, each in self.parameters.items()
            if isinstance(each, Extinction)
        }


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """Materials by triangle."""

    meshes: Meshes
    names: tuple[str, ...]
    materials: UInt  # 0 for none that is tracked, else 1 + index in `names`
    coated: Bool | None  # None where no tracked material is

    @classmethod
    def of(
        cls, tracked: Mapping[str, str], meshes: Meshes, objects: Sequence[SceneObject]
    ) -> "_Surfaces":
        numbers = {material: 1 + k for k, material in enumerate(tracked.values())}
        materials = np.zeros(meshes.triangles, np.uint32)
        coated = np.zeros(meshes.triangles, bool)
        for number, thing in enumerate(objects):
            if thing.material.name in numbers:
                part = meshes.triangles_of(number)
                materials[part] = numbers[thing.material.name]
                coated[part] = is_coated(thing.material)
        return cls(
            meshes,
            tuple(tracked),
            mi.UInt32(materials),
            mi.Bool(coated) if coated.any() else None,
        )

    def scores(
        self,
        context: Object,
        si: Hit,
        towards: Vector,
        value: Callable[[Bool], Float],
        active: Bool,
    ) -> Scores:
        """1 for the surface's material, or the fraction of its `value` that is the body's."""
        active &= si.is_valid()
        triangle = self.meshes.triangle(si, active)
        material = dr.gather(mi.UInt32, self.materials, triangle, active)
        fraction = mi.Float(1)
        if self.coated is not None:
            coated = active & dr.gather(mi.Bool, self.coated, triangle, active)
            body = mi.BSDFContext(context.mode, mi.BSDFFlags.DiffuseReflection)
            scaled, whole = si.bsdf().eval(body, si, towards, coated).x, value(coated)
            scaled = dr.select(whole > 0, scaled / whole, 0)
            fraction = dr.select(coated, scaled, fraction)
        return {
            name: dr.select(active & (material == 1 + k), fraction, 0)
            for k, name in enumerate(self.names)
        }


def is_coated(material: Material) -> bool:
    """Whether the reflectance scales a diffuse body alone, not what the surface above returns."""
    bsdf = material.bsdf
    if isinstance(bsdf, Principled):
        return bsdf.metallic < 1
    return isinstance(bsdf, Plastic | RoughPlastic | Retroreflector)


def _henyey_greenstein(g: float, incoming: Vector, outgoing: Vector) -> Float:
    """Derivative of the logarithm of the phase function by its g."""
    asymmetry = dr.opaque(mi.Float, g)
    cosine = dr.dot(incoming, outgoing)
    spread = 1 + asymmetry * asymmetry - 2 * asymmetry * cosine
    return 3 * (cosine - asymmetry) / spread - 2 * asymmetry / (1 - asymmetry * asymmetry)
