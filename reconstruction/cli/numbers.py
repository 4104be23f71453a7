"""Numbers in options; argparse adds the option's name to errors."""

import argparse
import re

import numpy as np


def whole_number(text: str) -> int:
    """Parse a count from 1."""
    if not (text.isascii() and text.isdigit()) or not 1 <= int(text) <= 10**9:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1")
    return int(text)


def number(text: str) -> float:
    """Parse a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def shape(text: str) -> tuple[int, int]:
    """Parse rows and columns."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form 32x32 (rows x columns)")
    return int(match[1]), int(match[2])


def angles(text: str) -> tuple[float, float]:
    """Parse angles of view in degrees, between 0 and 180."""
    width, _, height = text.partition("x")
    result = number(width), number(height)
    if not all(0 < each < 180 for each in result):
        raise argparse.ArgumentTypeError(f"{text!r}: both angles must lie between 0 and 180 deg")
    return result


def band(text: str) -> tuple[float, float]:
    """Parse a band of wavelengths, low to high."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)-(\d+(?:\.\d+)?)", text)
    if match is None or float(match[1]) > float(match[2]):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form 530-560 (nm, low to high)")
    return float(match[1]), float(match[2])
