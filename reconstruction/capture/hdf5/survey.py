"""Survey of an HDF5 file before anything in it is read.

Links, external storage and virtual datasets could make the reader open other files of its user;
they are refused and never followed.
"""

import h5py
from h5py import h5d, h5g, h5l, h5o

from ...base.errors import InputError

MAX_OBJECTS = 10_000
"""Maximum number of groups and datasets of a file, and of links of a group."""
MAX_DEPTH = 32
"""Maximum depth of nested groups."""
MAX_NAME_BYTES = 1024

_LINKS = {h5l.TYPE_SOFT: "a soft link", h5l.TYPE_EXTERNAL: "a link to another file"}


def survey(file: h5py.File) -> dict[str, h5py.Dataset]:
    """List all datasets of a file by path, without reading them.

    Raises InputError for links that are not hard, objects with two names (and so for cycles),
    objects that are neither groups nor datasets, data stored in other files, and beyond the limits.
    """
    root = h5g.open(file.id, b"/")
    datasets: dict[str, h5py.Dataset] = {}
    addresses = {h5o.get_info(root).addr}
    groups = [("", root)]
    while groups:
        path, group = groups.pop()
        for name, address in _members(path, group):
            where = f"{path}{name.decode()}"
            if address in addresses:
                raise InputError(f"{where} is a second name of the same group or dataset")
            addresses.add(address)
            if len(addresses) > MAX_OBJECTS:
                raise InputError(f"holds more than {MAX_OBJECTS} groups and datasets")
            child = h5o.open(group, name)
            if isinstance(child, h5d.DatasetID):
                _check_storage(where, child)
                datasets[where] = h5py.Dataset(child, readonly=True)  # caches its shape
            elif isinstance(child, h5g.GroupID):
                if where.count("/") >= MAX_DEPTH:
                    raise InputError(f"holds groups within more than {MAX_DEPTH} groups")
                groups.append((f"{where}/", child))
            else:
                raise InputError(f"{where} is neither a group nor a dataset")
    return datasets


def _members(path: str, group: h5g.GroupID) -> list[tuple[bytes, int]]:
    """Names and addresses of the members of a group."""
    links: list[tuple[bytes, int, int]] = []

    def keep(name: bytes, info: h5l.LinkInfo) -> bool | None:
        links.append((bytes(name), info.type, info.u))
        return len(links) > MAX_OBJECTS or None  # anything but None ends the iteration

    group.links.iterate(keep, info=True)
    if len(links) > MAX_OBJECTS:
        raise InputError(f"holds more than {MAX_OBJECTS} groups and datasets")
    for name, kind, _ in links:
        if not 0 < len(name) <= MAX_NAME_BYTES or b"/" in name or name == b".":
            raise InputError(f"{path} holds a name that is empty, too long or a path")
        if kind != h5l.TYPE_HARD:
            what = _LINKS.get(kind, "a link of an unknown kind")
            raise InputError(
                f"{path}{name.decode()} is {what}; a file must hold all its data itself"
            )
    return [(name, address) for name, _, address in links]


def _check_storage(where: str, dataset: h5d.DatasetID) -> None:
    stored = dataset.get_create_plist()
    if stored.get_layout() == h5d.VIRTUAL:
        raise InputError(f"{where} is a virtual dataset; a file must hold its data itself")
    if stored.get_layout() == h5d.CONTIGUOUS and stored.get_external_count():
        raise InputError(f"{where} is stored in other files; a file must hold its data itself")
