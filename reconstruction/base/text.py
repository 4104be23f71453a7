"""Untrusted text, made safe to display."""

import codecs
import json
import os
import re
import sys
import unicodedata
from contextlib import suppress
from io import TextIOWrapper
from typing import Any

#: Control characters but tab and line feed, direction overrides, surrogates.
_STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]"
)

#: Limits of a message: letters of a word, which may be any name or value, and in total.
MAX_LETTERS, MAX_CHARACTERS = 400, 4000

#: ASCII substitutes for characters that this software writes.
_PLAIN = {"×": "x", "·": "*", "–": "-", "−": "-", "⁻": "^-", "√": "sqrt ", "≤": "<=", "≥": ">="}
_PLAIN |= {"°": " deg", "’": "'", "µ": "u", "α": "alpha", "σ": "sigma", "ρ": "rho", "λ": "lambda"}


def printable(text: str) -> str:
    """Text with escapes in place of characters that could control a terminal or its direction."""
    return _STEERING.sub(_escape, text)


def shortened(text: str) -> str:
    """Message whose words and total length are limited, with the middle left out."""
    words = re.sub(rf"\S{{{MAX_LETTERS + 1},}}", lambda word: _ends(word[0], MAX_LETTERS), text)
    return _ends(words, MAX_CHARACTERS)


def _ends(text: str, maximum: int) -> str:
    """Beginning and end of a text that is too long."""
    return text if len(text) <= maximum else f"{text[: maximum // 2]}…{text[-maximum // 4 :]}"


def _escape(match: re.Match[str]) -> str:
    code = ord(match[0])
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


def json_line(report: Any) -> str:
    """JSON object in ASCII, which every terminal can display. Raises ValueError for NaN."""
    return json.dumps(report, allow_nan=False).replace("\x7f", r"\u007f")


def write_anything() -> None:
    """Let stdout and stderr of this process accept all text, whatever their encoding."""
    codecs.register_error("ascii substitutes", _in_ascii)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="ascii substitutes")


def flush_output() -> None:
    """Flush stdout; if nobody reads it or its disk is full, drop the rest and raise OSError."""
    if sys.stdout is None:
        return
    try:
        sys.stdout.flush()
    except OSError as error:
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise OSError(error.errno, error.strerror, "standard output") from None


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    """Codec error handler: ASCII in place of what an encoding lacks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(map(_ascii, lacking)), error.end


def _ascii(character: str) -> str:
    plain = _PLAIN.get(character) or unicodedata.normalize("NFKD", character)
    return plain if plain.isascii() else character.encode("ascii", "backslashreplace").decode()
