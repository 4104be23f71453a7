"""The references of all files that users write, for `make docs`.

Everything in them is from the sections that such files are read into, but for the examples, which
stand in `file_examples.yaml` and are read by the same sections.
"""

import dataclasses
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, TypeAdapter

from reconstruction.operators import BASES, ORDERS, POLARITIES
from spisim.atmosphere.droplets import FOGS, SMOKES
from spisim.atmosphere.mie_phase import PHASES
from spisim.atmosphere.rain import RAINS
from spisim.atmosphere.visibility import CONTRAST_THRESHOLDS
from spisim.base.config.distributions import KINDS
from spisim.dataset.plan import Plan
from spisim.dataset.study.metrics import QUANTITIES
from spisim.dataset.study.plan import StudyPlan
from spisim.dataset.values import Grid
from spisim.instrument import Instrument
from spisim.scene.bsdf import BSDFS
from spisim.scene.description import DrawnDescription, SceneDescription
from spisim_inverse.design.objectives import OBJECTIVES
from spisim_inverse.design.plan import DesignPlan

EXAMPLES = Path(__file__).parent / "file_examples.yaml"

#: Bounds of whole numbers beyond this are those of machines.
MET = 2**60

#: What the ends of names say of their values.
UNITS = {
    "_w_per_m2_sr": "W/(m² sr)",
    "_w_per_m2": "W/m²",
    "_w_per_sr": "W/sr",
    "_kcd_per_m2": "kcd/m²",
    "_pa_per_sqrt_hz": "pA/√Hz",
    "_pa_per_min": "pA/min",
    "_g_per_m3": "g/m³",
    "_kg_m3": "kg/m³",
    "_a_per_w": "A/W",
    "_mm_per_h": "mm/h",
    "_per_m": "1/m",
    "_deg_s": "°/s",
    "_m_s": "m/s",
    "_mm2": "mm²",
    "_klx": "klx",
    "_lm": "lm",
    "_deg": "°",
    "_mrad": "mrad",
    "_mm": "mm",
    "_nm": "nm",
    "_um": "µm",
    "_na": "nA",
    "_hz": "Hz",
    "_electrons": "electrons",
    "_counts": "counts",
    "_w": "W",
    "_m": "m",
    "_s": "s",
}


@dataclass
class Sections:
    """A JSON Schema, and the parts of it that wait to be described."""

    definitions: Mapping[str, Any]
    described: set[str] = field(default_factory=set)

    def of(self, name: str) -> Any:
        """The section of this name."""
        return self.definitions[name]


def scene_page(examples: Mapping[str, Any]) -> str:
    """Reference of scene files."""
    schema = TypeAdapter(SceneDescription | DrawnDescription).json_schema()
    sections = Sections(schema["$defs"])
    parts = [
        "# Scene files: every field\n",
        "A scene file has these sections. [Scenes](../scenes.md), [weather](../weather.md) and "
        "[materials](materials.md) say what they are for; `spisim schema scene` prints the "
        "same for editors and programs.\n",
        _HOW_TO_READ,
        *alternatives(
            "The file", ["SceneDescription", "DrawnDescription"], sections, examples, _SCENE_FILES
        ),
        *_bsdf_table(),
        "## Names\n",
        _names("kind of `fog` and `volumes`", FOGS),
        _names("kind of `smoke`", SMOKES),
        _names("kind of `rain`", RAINS),
        _names("definition", CONTRAST_THRESHOLDS),
        _names("phase of fog by visibility or water", PHASES),
        "Materials are listed in [materials](materials.md), families in the "
        "[gallery](scene-gallery.md#families).\n",
    ]
    return "\n".join(parts)


def instrument_page(examples: Mapping[str, Any]) -> str:
    """Reference of instrument files."""
    schema = TypeAdapter(Instrument).json_schema()
    sections = Sections({**schema["$defs"], "Instrument": schema})
    parts = [
        "# Instrument files: every field\n",
        "An instrument file has these sections. [The instrument](../instrument.md) says what they "
        "are for; `spisim schema instrument` prints the same for editors and programs.\n",
        _HOW_TO_READ,
        *one("The file", "Instrument", sections, examples),
        "## Names\n",
        _names("basis", BASES),
        _names("order and layout", ORDERS),
        _names("polarity", POLARITIES),
        "[Bases and orders](../theory/patterns.md#bases-and-orders) says what they are; those "
        "that are drawn by chance take a seed, as in `random:7`.\n",
    ]
    return "\n".join(parts)


def plan_page(examples: Mapping[str, Any]) -> str:
    """Reference of the plans of data sets and studies."""
    schema = TypeAdapter(StudyPlan).json_schema()
    schema["description"] = TypeAdapter(Plan).json_schema()["description"]
    open_values: dict[str, type[BaseModel]] = {**KINDS, "grid": Grid}
    drawn = {kind.__name__: TypeAdapter(kind).json_schema() for kind in open_values.values()}
    sections = Sections({**schema["$defs"], **drawn, "StudyPlan": schema})
    parts = [
        "# Plan and study files: every field\n",
        "The plan of a data set has these sections but `study`, that of a study all of them. "
        "[Data sets](../datasets.md) and [studies](../studies.md) say what they are for; `spisim "
        "schema plan` and `spisim schema study` print the same for editors and programs.\n",
        _HOW_TO_READ,
        *one("The file", "StudyPlan", sections, examples),
        "## Values that are drawn\n",
        "Fields of `vary` and `materials`, `wavelength_nm` and a family's `parameters` may have "
        "such a section in place of a value, and in `vary` also parts of a value. A grid stands "
        "for a whole field of `vary` or `materials`, for `instrument` or `wavelength_nm`.\n",
        *(
            chapter
            for name, kind in open_values.items()
            for chapter in one(f"`{name}`", kind.__name__, sections, examples)
        ),
        "## Metrics\n",
        "| metric | what it is |\n|---|---|",
        *(f"| `{name}` | {quantity.meaning} |" for name, quantity in QUANTITIES.items()),
        "",
    ]
    return "\n".join(parts)


def design_page(examples: Mapping[str, Any]) -> str:
    """Reference of the plans of designs."""
    schema = TypeAdapter(DesignPlan).json_schema()
    sections = Sections({**schema["$defs"], "DesignPlan": schema})
    parts = [
        "# Design files: every field\n",
        "The plan of `spisim design` has these sections. [Designing an "
        "instrument](../howto/designing.md) says what they are for.\n",
        _HOW_TO_READ,
        *one("The file", "DesignPlan", sections, examples),
        "## Objectives\n",
        "| objective | what it is | unit |\n|---|---|---|",
        *(f"| `{name}` | {each.title} | {each.unit} |" for name, each in OBJECTIVES.items()),
        "",
    ]
    return "\n".join(parts)


_HOW_TO_READ = (
    "Fields without a default are needed; *none* means that a field may be left out. Field names "
    "end in their units.\n"
)
_SCENE_FILES = {"SceneDescription": "whole scenes", "DrawnDescription": "scenes of a family"}


def one(title: str, name: str, sections: Sections, examples: Mapping[str, Any]) -> Iterator[str]:
    """Chapter of a section, and of those in its fields."""
    section = sections.of(name)
    sections.described.add(name)
    yield f"## {title}\n"
    yield _text(section)
    yield _table(section, section["properties"], examples.get(name, {}))
    yield from _inner(title, section["properties"], sections, examples)


def alternatives(
    title: str,
    names: list[str],
    sections: Sections,
    examples: Mapping[str, Any],
    called: Mapping[str, str],
) -> Iterator[str]:
    """Chapter of a field that is one of several sections: what they share, and what they do not."""
    sections.described.update(names)
    all_fields = [sections.of(name)["properties"] for name in names]
    shared = {
        name: schema
        for name, schema in all_fields[0].items()
        if all(_same(other.get(name), schema) for other in all_fields[1:])
    }
    yield f"## {title}\n"
    if shared:
        yield "All of them have\n"
        given = {k: v for name in reversed(names) for k, v in examples.get(name, {}).items()}
        yield _table(sections.of(names[0]), shared, given)
    for name, fields in zip(names, all_fields, strict=True):
        yield f"### {title}: {called.get(name, name)}\n"
        yield _text(sections.of(name))
        own = {field: schema for field, schema in fields.items() if field not in shared}
        if own:
            yield _table(sections.of(name), own, examples.get(name, {}))
    for fields in all_fields:
        yield from _inner(title, fields, sections, examples)


def _same(one: Any, other: Any) -> bool:
    """Whether two fields are alike; what they call their title does not count."""
    return json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def _inner(
    title: str, fields: Mapping[str, Any], sections: Sections, examples: Mapping[str, Any]
) -> Iterator[str]:
    """Chapters of the sections that stand in these fields, each described once."""
    above = "" if title == "The file" else title.strip("`") + "."
    for name, schema in fields.items():
        wanted = [ref for ref in _refs(schema) if ref not in sections.described]
        if not wanted:
            continue
        path = f"`{above}{name}`"
        if len(wanted) == 1:
            yield from one(path, wanted[0], sections, examples)
        else:
            called = {ref: _discriminator_of(sections.of(ref)) for ref in wanted}
            yield from alternatives(path, wanted, sections, examples, called)


def _discriminator_of(section: Any) -> str:
    """What discriminates this one of several sections: the word of a field, or the field itself."""
    for name, schema in section["properties"].items():
        if "const" in schema:
            return f"`{name}: {schema['const']}`"
    shape = [name for name in ("mesh", "object", "radius_m", "size_m") if _has(section, name)]
    return f"with `{shape[0]}`" if shape else section["title"].lower()


def _has(section: Any, name: str) -> bool:
    return name in section["properties"]


def _refs(schema: Any) -> list[str]:
    """Names of the sections that a field may hold."""
    if isinstance(schema, list):
        return [ref for part in schema for ref in _refs(part)]
    if not isinstance(schema, dict):
        return []
    result = [schema["$ref"].rpartition("/")[2]] if "$ref" in schema else []
    inside = [v for k, v in schema.items() if k in ("anyOf", "oneOf", "items", "prefixItems")]
    inside += [schema["additionalProperties"]] if "additionalProperties" in schema else []
    return result + [ref for part in inside for ref in _refs(part)]


def _text(section: Any) -> str:
    return section.get("description", "") + "\n"


def _table(section: Any, fields: Mapping[str, Any], examples: Mapping[str, Any]) -> str:
    rows = [
        "| field | what it is | allowed | unit | default | example |",
        "|---|---|---|---|---|---|",
    ]
    for name, schema in fields.items():
        needed = name in section.get("required", ())
        cells = [
            f"`{name}`",
            schema.get("description", "").replace("\n", " "),
            allowed(schema),
            unit(name, schema),
            "**needed**" if needed else _default(schema),
            _code(examples[name]) if name in examples else "",
        ]
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"


def unit(name: str, schema: Any) -> str:
    """Unit that the field's name ends in."""
    if _words(schema):
        return ""
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def _words(schema: Any) -> bool:
    return "enum" in schema or "const" in schema


def _default(schema: Any) -> str:
    value = schema.get("default")
    if value is None or value == [] or value == "" or value == {}:
        return "*none*"
    if isinstance(value, dict):
        given = {k: v for k, v in value.items() if v is not None}
        return "its own defaults" if given else "*none*"
    return _code(value)


def _code(value: Any) -> str:
    """A value as a file has it."""
    text = yaml.safe_dump(
        _short(value), default_flow_style=True, width=10_000, allow_unicode=True, sort_keys=False
    )
    return f"`{text.removesuffix(chr(10)).removesuffix('...').strip()}`"


def _short(value: Any) -> Any:
    """The same with whole numbers for numbers that are."""
    if isinstance(value, dict):
        return {name: _short(part) for name, part in value.items()}
    if isinstance(value, list):
        return [_short(part) for part in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value


def allowed(schema: Any) -> str:
    """Type and bounds of a field, in words."""
    kinds = [allowed(part) for part in schema.get("anyOf", schema.get("oneOf", ()))]
    kinds = list(dict.fromkeys(kind for kind in kinds if kind))
    if kinds:
        return _bounded(" or ".join(kinds), schema)
    if "$ref" in schema:
        return "section"
    if _words(schema):
        return ", ".join(f"`{word}`" for word in schema.get("enum", [schema.get("const")]))
    match schema.get("type"):
        case "null":
            return ""
        case "boolean":
            return "`true`, `false`"
        case "array":
            return _list(schema)
        case "object":
            return _mapping(schema)
        case "string":
            return "file" if schema.get("format") == "path" else "text"
        case "number" | "integer" as kind:
            return _bounded("number" if kind == "number" else "whole number", schema)
    return "anything"


def _bounded(kind: str, schema: Any) -> str:
    """A number and its bounds, but for those that nobody meets."""
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    ends = [
        f"{sign} {bound:.7g}"
        for name, sign in signs.items()
        if (bound := schema.get(name)) is not None and abs(bound) < MET
    ]
    return " ".join([kind, " and ".join(ends)]).strip()


def _list(schema: Any) -> str:
    if "prefixItems" in schema:
        parts = [allowed(part) for part in schema["prefixItems"]]
        same = len(set(parts)) == 1
        return f"{len(parts)} × {parts[0]}" if same else "[" + ", ".join(parts) + "]"
    inside = allowed(schema.get("items", {}))
    if inside == "section" or " or section" in inside:
        inside = "section"
    low, high = schema.get("minItems"), schema.get("maxItems")
    if low == high and low is not None:
        return f"{low} × ({inside})"
    ends = [f"{low} or more" if low else "", f"{high} at most" if high else ""]
    count = ", ".join(end for end in ends if end)
    return f"list of {inside}" + (f" ({count})" if count else "")


def _mapping(schema: Any) -> str:
    inside = schema.get("additionalProperties")
    if not isinstance(inside, dict):
        return "mapping"
    return f"mapping from {_keys(schema)} to {allowed(inside)}"


def _keys(schema: Any) -> str:
    """Spectra are from wavelengths, all others from names."""
    return "nm" if allowed(schema["additionalProperties"]).startswith("number") else "name"


def _bsdf_table() -> Iterator[str]:
    yield "## Models of `bsdf`\n"
    yield "| `bsdf` | what it is | parameters, with their defaults |"
    yield "|---|---|---|"
    for name, model in BSDFS.items():
        what = re.sub(r"\s+", " ", (model.__doc__ or "").partition("\n\n")[0])
        parameters = [
            f"`{part.name}`"
            + ("" if part.default is dataclasses.MISSING else f" ({_short(part.default)})")
            for part in dataclasses.fields(model)
        ]
        yield f"| `{name}` | {what} | {', '.join(parameters) or 'none'} |"
    yield ""


def _names(what: str, names: Any) -> str:
    return f"**{what}**: " + ", ".join(f"`{name}`" for name in names) + "\n"


def pages() -> dict[str, str]:
    """Text of each page, by its name within the folder of the reference."""
    examples = yaml.safe_load(EXAMPLES.read_text(encoding="utf-8"))
    return {
        "scene-file.md": scene_page(examples),
        "instrument-file.md": instrument_page(examples),
        "plan-file.md": plan_page(examples),
        "design-file.md": design_page(examples),
    }
