"""Pattern bases, one module each."""

from ...base.errors import InputError
from ...base.registry import Registry
from ..basis import Basis, generator_of

BASES: Registry[type[Basis]] = Registry(
    "pattern basis", package=__name__, attribute="BASIS", group="reconstruction.bases"
)


def basis_of(name: str, shape: tuple[int, int]) -> Basis:
    """Create a basis by name.

    Parameters
    ----------
    name
        Entry of `BASES`; a seeded basis takes its seed after a colon: ``"scrambled:7"``.
    shape
        Rows and columns of a pattern, in virtual pixels.

    Raises
    ------
    InputError
        If the name is unknown, a seed is missing or superfluous, or the basis needs arrays.
    """
    kind = BASES[name.partition(":")[0]]
    rng = generator_of("pattern basis", name, seeded=kind.seeded)
    if rng is not None:
        return kind.drawn(shape, rng)
    if kind.arrays:
        raise InputError(
            f"pattern basis {name!r}: needs {' and '.join(kind.arrays)}; pass a basis, not its name"
        )
    return kind.restored(shape, {})
