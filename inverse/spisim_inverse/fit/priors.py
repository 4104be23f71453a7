"""Gaussian priors of parameters, from text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

from reconstruction.base.errors import InputError, naming, nearest
from spisim.base.config import read_text
from spisim.base.config.yaml import load_yaml

PATTERN = re.compile(r"(?P<name>[^=]+)=(?P<mean>[^±]+?)\s*(?:±|\+-|\+/-)\s*(?P<sigma>.+)")


@dataclass(frozen=True)
class Prior:
    """A normal distribution of a parameter's value."""

    mean: float
    sigma: float


def parsed_priors(texts: Sequence[str]) -> dict[str, Prior]:
    """Priors by parameter, of texts such as ``scene.fog.visibility_m=50±10``."""
    priors = {}
    for text in texts:
        match = PATTERN.fullmatch(text.strip())
        if match is None:
            raise InputError(f"--prior {text!r}: must be NAME=MEAN±SIGMA, or NAME=MEAN+-SIGMA")
        name = match["name"].strip()
        priors[name] = Prior(*(_number(name, match[part]) for part in ("mean", "sigma")))
    return priors


def parsed_starts(texts: Sequence[str]) -> dict[str, float | None]:
    """Starts by parameter, of texts such as ``NAME`` or ``NAME=50``; None where none is given."""
    starts: dict[str, float | None] = {}
    for text in (part for each in texts for part in each.split(",")):
        name, equals, value = (part.strip() for part in text.partition("="))
        if name in starts:
            raise InputError(f"--free {name} is given twice")
        starts[name] = _number(name, value) if equals else None
    return starts


def read_priors(path: Path) -> dict[str, Prior]:
    """Priors of a YAML file, a mapping of names to texts such as ``50±10``."""
    with naming(path):
        fields = load_yaml(read_text(path), path)
        if not isinstance(fields, Mapping):
            raise InputError("must be a mapping of parameters to texts such as 50±10")
        return parsed_priors([f"{name}={value}" for name, value in fields.items()])


def check_priors(priors: Mapping[str, Prior], names: Sequence[str]) -> None:
    """Raise InputError for priors of what is not free, and for those that are no distribution."""
    for name, prior in priors.items():
        if name not in names:
            raise InputError(f"prior of {name!r}, which is not free: {nearest(name, names)}")
        if not isfinite(prior.mean):
            raise InputError(f"prior of {name}: the mean is {prior.mean:g}; must be finite")
        if not 0 < prior.sigma < float("inf"):  # nor nan
            raise InputError(f"prior of {name}: sigma is {prior.sigma:g}; must be positive, finite")


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{name}: {text.strip()!r} is not a number") from None
