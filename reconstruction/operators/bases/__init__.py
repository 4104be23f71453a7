"""Pattern bases, one module each."""

from ...base.errors import InputError
from ...base.registry import Registry
from ..basis import Basis
from ..seeds import generator_of

BASES: Registry[type[Basis]] = Registry(
    "pattern basis", package=__name__, attribute="BASIS", group="reconstruction.bases"
)


def basis_of(name: str, shape: tuple[int, int]) -> Basis:
    """The basis of this name and shape, of a seeded one with its seed, as "scrambled:7".

    Raises InputError for an unknown name, a seed that is missing or not needed, and a basis that
    name and shape do not tell.
    """
    kind = BASES[name.partition(":")[0]]
    rng = generator_of("pattern basis", name, seeded=kind.seeded)
    if rng is not None:
        return kind.drawn(shape, rng)
    if kind.arrays:
        raise InputError(f"pattern basis {name!r}: its {' and '.join(kind.arrays)} must be given")
    return kind.restored(shape, {})
