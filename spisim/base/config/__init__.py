"""YAML files read into pydantic models, with errors that say what to change.

Every configuration file of the simulator goes through `parse_model`. Whatever is wrong with a file
ends as one `InputError` that names file, field, value and what is allowed.
"""

from spisim.base.config.fields import (
    Count,
    Fraction,
    LightSource,
    Name,
    NonNegative,
    Number,
    Positive,
    Section,
    Vector,
    named,
    not_a_truth_value,
    one_of,
)
from spisim.base.config.messages import reason
from spisim.base.config.reading import (
    check_fields,
    find_named,
    is_file,
    parse_model,
    read_mapping,
    read_text,
    shipped,
)
from spisim.base.config.yaml import dump_yaml, load_yaml

__all__ = [
    "Count",
    "Fraction",
    "LightSource",
    "Name",
    "NonNegative",
    "Number",
    "Positive",
    "Section",
    "Vector",
    "check_fields",
    "dump_yaml",
    "find_named",
    "is_file",
    "load_yaml",
    "named",
    "not_a_truth_value",
    "one_of",
    "parse_model",
    "read_mapping",
    "read_text",
    "reason",
    "shipped",
]
