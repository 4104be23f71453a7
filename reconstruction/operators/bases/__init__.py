"""Pattern bases, one module each."""

from ...registry import Registry
from ..basis import Basis

BASES: Registry[type[Basis]] = Registry(
    "pattern basis", package=__name__, attribute="BASIS", group="reconstruction.bases"
)
