"""Two files to compare: captures or arrays."""

from pathlib import Path

from reconstruction import read_capture
from reconstruction.base.errors import InputError, naming

from .arrays import ENDING, compare_arrays, read_array
from .comparing import compare
from .comparison import Comparison


def compare_files(real: Path, simulated: Path) -> Comparison:
    """Compare two files of the same kind; raises InputError if they are not comparable."""
    arrays = [path.suffix.lower() == ENDING for path in (real, simulated)]
    if arrays[0] != arrays[1]:
        array, capture = (real, simulated) if arrays[0] else (simulated, real)
        raise InputError(
            f"{array} is an array, {capture} a capture; allowed: two captures (.h5), or two arrays "
            f"({ENDING})"
        )
    if arrays[0]:
        one, other = read_array(real), read_array(simulated)
        with naming(f"{real} and {simulated}"):
            return compare_arrays(one, other)
    recorded, expected = read_capture(real), read_capture(simulated)
    with naming(f"{real} and {simulated}"):
        return compare(recorded, expected)
