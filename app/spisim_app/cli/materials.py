"""`spisim materials`: materials of surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from . import complete
from .console import print_json, results
from .options import Json, real_option
from .tables import print_table, word_table

if TYPE_CHECKING:
    from spisim.scene.materials import Material

EXAMPLE = "spisim materials concrete --wavelength 905"


def command(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="MATERIAL",
            help="Describe only this one, with its source.",
            autocompletion=complete.materials,
        ),
    ] = None,
    wavelength: Annotated[
        float, real_option("Wavelength of the instrument.", minimum=800, maximum=1600, metavar="NM")
    ] = 1550.0,
    json: Json = False,
) -> None:
    """List the shipped materials: their reflectance at a wavelength, and their model."""
    from spisim.scene.materials import find_material, material_table

    if name is not None:
        _tell(find_material(name, wavelength_nm=wavelength), wavelength, json)
        return
    materials = material_table(wavelength)
    if json:
        rows = [_summary(material) for material in materials.values()]
        print_json({"wavelength_nm": wavelength, "materials": rows})
        return
    table = word_table("material", f"reflectance at {wavelength:g} nm", "how")
    for material in materials.values():
        table.add_row(material.name, f"{material.reflectance:.3g}", _how(material))
    print_table(table)
    results.print(
        "\nReflectance of the diffuse body, or of direct backscatter without one. Sources: "
        "spisim materials NAME",
        style="dim",
        soft_wrap=True,
    )


def _tell(material: Material, wavelength_nm: float, json: bool) -> None:
    if json:
        print_json({"wavelength_nm": wavelength_nm, **_summary(material)})
        return
    numbers = {"reflectance": material.reflectance, **vars(material.bsdf)}
    results.print(f"{material.name}: {_how(material)}, at {wavelength_nm:g} nm")
    for field, value in numbers.items():
        results.print(f"  {field}: {value:.3g}")
    results.print(f"source: {material.source}", soft_wrap=True)


def _how(material: Material) -> str:
    """Return the name of its model in scene files."""
    from spisim.scene.bsdf import BSDFS

    return next(name for name, model in BSDFS.items() if type(material.bsdf) is model)


def _summary(material: Material) -> dict[str, Any]:
    """Return a JSON-ready summary."""
    return {
        "name": material.name,
        "reflectance": material.reflectance,
        "bsdf": _how(material),
        **vars(material.bsdf),
        "source": material.source,
    }
