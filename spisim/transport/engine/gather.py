"""Random walk from a sensor to lamps: each vertex is joined to every kind of lamp.

Light that is scattered close to a point lamp meets a 1/d², for which walks have no finite variance.
In fog, each segment of the walk is therefore also sampled at a point drawn equi-angularly about the
lamp (Kulla & Fajardo, EGSR 2012). The balance heuristic weighs it against the collision at which
the segment ends.

Light that reaches a point or parallel lamp only by mirrors and smooth glass is not found.
"""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.apertures import Detectors
from spisim.transport.engine.ends import Launch, Projector
from spisim.transport.engine.lamps import Lamps, Lit, Met
from spisim.transport.engine.tally import Contribution, Deposit, carries_light
from spisim.transport.engine.vertex import Turn, Vertex
from spisim.transport.engine.walk import MAX_VERTICES, lanes_and_sampler
from spisim.transport.engine.walk_state import PathState
from spisim.transport.geometry import EquiAngular
from spisim.transport.jit import Bool, Float, Point, Ray, Sampler, UInt
from spisim.transport.scores import Scored, Scores, together
from spisim.transport.world import World

#: Roulette keeps paths until they carry less than this fraction of their start.
ENDING = 0.25


#: Deposits light in some lanes.
Add = Callable[[Scored, Bool], None]


@dataclass
class _State(PathState):
    """A path of `Gather`."""

    before: Point  # last vertex, or the sensor
    density: Float  # of leaving it, 1/sr; infinite where no join finds what lies there
    scores: Scores

    @property
    def light(self) -> Scored:
        """What the path carries."""
        return Scored(self.beta, self.scores)


@dataclass(frozen=True, eq=False)
class Gather:
    """Paths from a sensor, which find the light of lamps."""

    world: World
    sensor: Projector | Detectors
    lamps: Lamps
    deposit: Deposit
    replicas: int = 1  # independent estimates, among which paths are dealt out

    @dr.syntax
    def run(self, seed: int, max_vertices: int = MAX_VERTICES) -> None:
        """Launch one path per lane and deposit all light that it finds."""
        number, sampler = lanes_and_sampler(self.replicas * self.sensor.lanes, seed)
        replicas = dr.opaque(mi.UInt32, self.replicas)
        lane, replica = number // replicas, number % replicas
        limit = dr.opaque(mi.UInt32, max_vertices)
        launch = self.sensor.launch(lane, sampler)
        template = Contribution(mi.Float(0), launch.cell, mi.Float(0), mi.UInt32(0), False, replica)

        def add(light: Scored, active: Bool) -> None:
            lit = active & carries_light(light.value)
            each = template._replace(value=light.value, active=lit, scores=light.scores)
            self.deposit(each)

        if dr.hint(isinstance(self.sensor, Detectors), mode="scalar"):
            self._see(lane, add, sampler)
        path, scale = _start(launch, self.world.tracked.none), dr.rcp(launch.beta)
        while dr.hint(path.active, exclude=[self, add, scale, limit]):
            here, far = self._fly(path, add, limit, sampler)
            may_join = path.active & (path.vertex <= limit)
            for light in self.lamps.joined:
                lit = light.seen_from(here.point, sampler)
                self._join(here, lit, path, add, sampler, may_join)
            if dr.hint(self.lamps.points is not None, mode="scalar"):
                self._join_points(here, far, path, add, sampler, may_join)
            turn = here.turn(sampler.next_1d(path.active), sampler.next_2d(path.active))
            self._leave(here, turn, path)
            path.roulette(turn, scale, ENDING, limit + 1, sampler)

    def _fly(self, path: _State, add: Add, limit: UInt, sampler: Sampler) -> tuple[Vertex, Float]:
        """Fly to a surface or a collision, else end; also returns the distance to the surface."""
        media, ray = self.world.media, path.ray
        si = self.world.geometry.scene.ray_intersect(ray, path.active)
        collision = media.flight(ray, si.t, sampler, path.active)
        in_fog = path.active & (collision.distance < si.t)
        on_surface = path.active & ~in_fog & si.is_valid()
        far = dr.select(si.is_valid(), si.t, dr.opaque(mi.Float, 2 * self.world.radius_m))
        if self.lamps.points is not None and media.parts:
            self._join_along(ray, far, path, add, sampler, path.active & (path.vertex <= limit))
        distance = dr.select(in_fog, collision.distance, si.t)
        passed = self.world.tracked.along(ray, distance, sampler, path.active)
        path.scores = together(path.scores, passed)
        for around in self.lamps.around:
            self._meet(around.met(ray.d), path, add, path.active & ~in_fog & ~on_surface)
        if self.lamps.areas is not None:
            self._meet(self.lamps.areas.met(path.before, si, on_surface), path, add, on_surface)
        path.active &= in_fog | on_surface
        distance = dr.select(path.active, distance, 0)
        path.beta *= dr.select(in_fog, media.albedo(collision.medium), 1)
        here = Vertex(
            self.world,
            mi.BSDFContext(mi.TransportMode.Radiance),
            si,
            collision.medium,
            mi.Point3f(ray(distance)),
            ray.d,
            in_fog,
            on_surface,
        )
        return here, far

    def _meet(self, met: Met, path: _State, add: Add, active: Bool) -> None:
        """Deposit light of a lamp that the path has hit."""
        alone = (path.density == dr.inf) | (met.density == 0)
        fraction = dr.select(alone, 1, path.density / (path.density + met.density))
        add(path.light * met.radiance * fraction, active)

    def _join(
        self,
        here: Vertex,
        lit: Lit,
        path: _State,
        add: Add,
        sampler: Sampler,
        active: Bool,
        fraction: Float = 1,
    ) -> None:
        """Deposit a lamp's light that a vertex scatters."""
        lobe = here.lobe(lit.towards, active & (lit.irradiance > 0))
        balance = lit.density / (lit.density + lobe.forward)
        weight = dr.select(lit.density == dr.inf, fraction, balance)
        light = path.light * Scored(lobe.value, lobe.scores) * lit.irradiance * weight
        lit_up = active & carries_light(light.value)
        add(light * here.transmission(lit.towards, lit.gap_m, sampler, lit_up), lit_up)

    def _join_points(
        self, here: Vertex, far: Float, path: _State, add: Add, sampler: Sampler, active: Bool
    ) -> None:
        """Deposit the light of point lamps that a vertex scatters."""
        points, media = self.lamps.points, self.world.media
        assert points is not None
        number, position = points.choose(sampler)
        fraction = mi.Float(1)
        if media.parts:
            distance = dr.dot(here.point - path.ray.o, path.ray.d)
            angular = EquiAngular.about(position, path.ray, far).density(distance)
            flown = self._flown(path.ray, distance, here.point)
            fraction = dr.select(here.in_fog, flown / (flown + angular), 1)
        lit = points.chosen_from(number, position, here.point)
        self._join(here, lit, path, add, sampler, active, fraction)

    def _join_along(
        self, ray: Ray, far: Float, path: _State, add: Add, sampler: Sampler, active: Bool
    ) -> None:
        """Deposit point lamps' light that fog scatters along a ray, wherever the flight ends."""
        points, media = self.lamps.points, self.world.media
        assert points is not None
        number, position = points.choose(sampler)
        angular = EquiAngular.about(position, ray, far)
        distance = angular.sample(sampler.next_1d(active))
        point, density = mi.Point3f(ray(distance)), angular.density(distance)
        medium = media.pick(point, sampler.next_1d(active))
        lit = points.chosen_from(number, position, point)
        light = path.light * media.albedo(medium) * media.extinction_at(point) * lit.irradiance
        light *= dr.rcp(density + self._flown(ray, distance, point))
        active &= carries_light(light.value)
        scores = self.world.tracked.scattered_by(medium, ray.d, lit.towards, active)
        light *= Scored(media.phase(medium, point, ray.d, lit.towards, active), scores)
        light *= self.world.geometry.between(point, lit.towards, lit.gap_m, active)
        active &= carries_light(light.value)
        light *= self.world.transmittance(ray, distance, sampler, active)
        towards = mi.Ray3f(point, lit.towards)
        add(light * self.world.transmittance(towards, lit.gap_m, sampler, active), active)

    def _flown(self, ray: Ray, distance: Float, point: Point) -> Float:
        """Closed-form factors of the density with which a flight ends there by a collision."""
        media = self.world.media
        return media.extinction_at(point) * media.closed_form_transmittance(ray, distance)

    def _see(self, lane: UInt, add: Add, sampler: Sampler) -> None:
        """Deposit the direct light on a detector of lamps that no path can hit."""
        assert isinstance(self.sensor, Detectors)
        points = () if self.lamps.points is None else (self.lamps.points,)
        for light in (*self.lamps.parallel, *points):
            middle = dr.gather(mi.Point3f, self.sensor.positions, lane % self.sensor.count)
            lit = light.seen_from(middle, sampler)
            position = mi.Point3f(middle + lit.towards * lit.gap_m)
            end = self.sensor.connect(lane, position, sampler)
            value = (
                lit.irradiance * end.importance * lit.gap_m * lit.gap_m / self.sensor.samples_jit
            )
            active = carries_light(value)
            value *= self.world.geometry.between(middle, lit.towards, lit.gap_m, active)
            ray = mi.Ray3f(middle, lit.towards)
            add(self.world.transmittance(ray, lit.gap_m, sampler, active) * value, active)

    def _leave(self, here: Vertex, turn: Turn, path: _State) -> None:
        """Take the next direction."""
        path.beta *= turn.weight
        path.scores = together(path.scores, turn.scores)
        path.before = dr.select(turn.straight, path.before, here.point)
        density = dr.select(turn.specular, dr.inf, turn.forward)
        path.density = dr.select(turn.straight, path.density, density)
        path.follow(turn)


def _start(launch: Launch, scores: Scores) -> _State:
    beta = mi.Float(launch.beta)
    return _State(
        ray=mi.Ray3f(launch.origin, launch.direction),
        beta=beta,
        vertex=mi.UInt32(1),
        crossings=mi.UInt32(0),
        active=carries_light(beta),
        before=mi.Point3f(launch.origin),
        density=mi.Float(dr.inf),
        scores=scores,
    )
