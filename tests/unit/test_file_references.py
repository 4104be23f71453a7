"""References of files that users write: of today's program, complete, their examples right."""

from collections.abc import Iterator
from typing import Annotated, Any

import pytest
import yaml
from pydantic import BaseModel, TypeAdapter

import file_references
from spisim.atmosphere.sections import WEATHER
from spisim.base.config import Section
from spisim.base.config.distributions import KINDS
from spisim.dataset.study.plan import StudyPlan
from spisim.dataset.values import Grid
from spisim.instrument import Instrument
from spisim.instrument.sensors import SENSORS
from spisim.instrument.tofs import TOFS
from spisim.scene.description import DrawnDescription, SceneDescription
from spisim_inverse.design.plan import DesignPlan

EXAMPLES = yaml.safe_load(file_references.EXAMPLES.read_text(encoding="utf-8"))
ROOTS = [SceneDescription, DrawnDescription, Instrument, StudyPlan, DesignPlan]
ROOTS += [*KINDS.values(), Grid]


def below(section: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for each in section.__subclasses__():
        yield each
        yield from below(each)


def sections() -> dict[str, type[BaseModel]]:
    """Those that files are made of, by name."""
    for registry in (WEATHER, SENSORS, TOFS):
        list(registry.values())  # loads them
    result = {each.__name__: each for each in below(Section) if "families" not in each.__module__}
    return {name: result[name] for name in definitions()}


def definitions() -> dict[str, Any]:
    result = {}
    for root in ROOTS:
        schema = TypeAdapter(root).json_schema()
        result |= {**schema.pop("$defs", {}), root.__name__: schema}
    return result


def test_every_section_has_its_chapter() -> None:
    """Each field of each section stands in a table of one of the pages."""
    text = "\n".join(file_references.pages().values())
    left = [
        f"{name}.{field}"
        for name, section in definitions().items()
        for field in section["properties"]
        if f"| `{field}` |" not in text
    ]
    assert not left


def test_every_field_is_described() -> None:
    bare = [
        f"{name}.{field}"
        for name, section in definitions().items()
        for field, reported in section["properties"].items()
        if not reported.get("description")
    ]
    assert not bare


def test_bounds_are_those_of_json_schema() -> None:
    angle = definitions()["Projector"]["properties"]["fov_deg"]
    assert (angle["exclusiveMinimum"], angle["exclusiveMaximum"]) == (0, 180)
    assert definitions()["AmbientDescription"]["properties"]["sun_klx"]["minimum"] == 0
    left = {"gt", "ge", "lt", "le"}
    assert not [reported for reported in every_part(definitions()) if left & reported.keys()]


def every_part(reported: Any) -> Iterator[dict[str, Any]]:
    if isinstance(reported, dict):
        yield reported
    for part in (
        reported.values()
        if isinstance(reported, dict)
        else reported
        if isinstance(reported, list)
        else ()
    ):
        yield from every_part(part)


def test_every_example_is_read_by_its_section() -> None:
    by_name = sections()
    for name, fields in EXAMPLES.items():
        section = by_name[name]
        section.model_rebuild()
        given = section.model_fields
        for field, value in fields.items():
            if field in given:  # sections that are alike share their examples
                wanted = Annotated[given[field].annotation, None, *given[field].metadata]
                TypeAdapter(wanted).validate_python(value)


def test_every_field_that_holds_no_section_has_an_example() -> None:
    for name, page in file_references.pages().items():
        rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| `")]
        bare = [
            row[0] for row in rows if len(row) == 6 and "section" not in row[2] and row[5] == " |"
        ]
        assert not bare, name


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("velocity_m_s", "m/s"),
        ("angular_velocity_deg_s", "°/s"),
        ("sun_klx", "klx"),
        ("radiance_w_per_m2_sr", "W/(m² sr)"),
        ("time_s", "s"),
        ("albedo", ""),
        ("gain", ""),
    ],
)
def test_units_are_read_off_names(name: str, unit: str) -> None:
    assert file_references.unit(name, {"type": "number"}) == unit
