"""Words of strangers, shown so that they can do nothing."""

import codecs
import json
import os
import re
import sys
import unicodedata
from contextlib import suppress
from io import TextIOWrapper
from typing import Any

#: Control characters but tabs and line breaks, turns of the writing's direction, halves of others.
_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]"
)

#: Of a message: letters of a word without spaces, as names and values may be, and of all of it.
MAX_LETTERS, MAX_CHARACTERS = 400, 4000

#: How characters that this software writes are told where there is nothing but ASCII.
_PLAIN = {
    "×": "x",
    "·": "*",
    "–": "-",
    "−": "-",
    "⁻": "^-",
    "√": "sqrt ",
    "≤": "<=",
    "≥": ">=",
    "°": " deg",
    "’": "'",
    "µ": "u",
    "α": "alpha",
    "σ": "sigma",
    "ρ": "rho",
    "λ": "lambda",
}


def printable(text: str) -> str:
    """Text in which whatever could steer a terminal, or turn its writing, is shown as an escape."""
    return _STEERING.sub(_escape, text)


def shortened(text: str) -> str:
    """A message whose words, and all of it, are short enough to be read: the middle is left out."""
    words = re.sub(rf"\S{{{MAX_LETTERS + 1},}}", lambda word: _ends(word[0], MAX_LETTERS), text)
    return _ends(words, MAX_CHARACTERS)


def _ends(text: str, maximum: int) -> str:
    """The beginning and the end of what is too long."""
    return text if len(text) <= maximum else f"{text[: maximum // 2]}…{text[-maximum // 4 :]}"


def _escape(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def json_line(report: Any) -> str:
    """One JSON object in ASCII, so that it passes every terminal. Raises ValueError for NaN."""
    return json.dumps(report, allow_nan=False).replace("\x7f", r"\u007f")


def write_anything() -> None:
    """Let stdout and stderr of this process take all text, whatever their encoding has."""
    codecs.register_error("told plainly", _in_ascii)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="told plainly")


def flush_output() -> None:
    """Hand on what was printed, or raise OSError: nobody reads it, or its disk is full.

    What is left is dropped then, so that the end of the program does not try again.
    """
    if sys.stdout is None:
        return
    try:
        sys.stdout.flush()
    except OSError as error:
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise OSError(error.errno, error.strerror, "standard output") from None


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    """An error handler of codecs: what an encoding lacks, in ASCII."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(map(_ascii, lacking)), error.end


def _ascii(character: str) -> str:
    plain = _PLAIN.get(character) or unicodedata.normalize("NFKD", character)
    return plain if plain.isascii() else character.encode("ascii", "backslashreplace").decode()
