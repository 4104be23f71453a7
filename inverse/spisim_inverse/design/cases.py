"""Scenes of a design in its weathers."""

from collections.abc import Sequence
from typing import Literal

from reconstruction.base.errors import InputError, naming
from spisim.base.config.distributions import stream
from spisim.scene import Scene, draw_scene, load_scene
from spisim_inverse.design.light import Case
from spisim_inverse.design.plan import PlannedDesign, Source, weather_of

MAX_SEED = 2**31
"""Upper bound of the seeds of scenes."""
Part = Literal["search", "judgement"]


def make_cases(planned: PlannedDesign, part: Part) -> list[Case]:
    """All scenes of a part in all weathers, scene by scene.

    Raises
    ------
    InputError
        Names plan, part and source, for a scene that cannot be made or in which something moves.
    """
    plan = planned.plan
    sources: Sequence[Source] = getattr(plan, part)
    cases = []
    for source in sources:
        for number in range(source.count):
            for weather in plan.weathers:
                with naming(f"{planned.path}: {part}"):
                    scene = _made(planned, part, source, number, weather)
                cases.append(Case(f"{source.world} {number}", weather, scene))
    return cases


def _made(planned: PlannedDesign, part: Part, source: Source, number: int, weather: str) -> Scene:
    changes = weather_of(planned.plan, weather)
    wavelength_nm = planned.instrument.wavelength_nm
    if source.scene is not None:
        file = planned.scene_file(source.scene)
        scene = load_scene(file, changes=changes, wavelength_nm=wavelength_nm)
    else:
        world = str(source.family)
        seed = int(stream(planned.plan.seed, part, world, number).integers(MAX_SEED))
        given = {name: section for name, section in changes.items() if section is not None}
        scene = draw_scene(world, seed, source.parameters, given, wavelength_nm=wavelength_nm)
    if scene.moves:
        raise InputError(f"{source.world}: something moves in it; a design needs scenes at rest")
    return scene
