"""Writes the mesh files of the warehouse: `python tools/warehouse_meshes.py`."""

from pathlib import Path

from trimesh.exchange.ply import export_ply

from spisim_worlds.parts import props

MESHES = Path(__file__).parents[1] / "scenes" / "meshes"

MAKERS = (
    props.pallet,
    props.rack,
    props.open_carton,
    props.drum,
    props.cone,
    props.gas_cylinder,
    props.ladder,
    props.pallet_jack,
    props.worker_clothes,
    props.worker_skin,
    props.worker_hat,
    props.lamp,
    props.tyre,
)


def main() -> None:
    """Write one binary PLY per object."""
    MESHES.mkdir(exist_ok=True)
    for make in MAKERS:
        mesh = make()
        path = MESHES / f"{make.__name__}.ply"
        path.write_bytes(export_ply(mesh, vertex_normal=False))
        print(f"{path.name:20} {len(mesh.faces):5} triangles {path.stat().st_size / 1000:6.1f} kB")


if __name__ == "__main__":
    main()
