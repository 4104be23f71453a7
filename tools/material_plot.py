"""Draw the picture of docs/theory/materials.md; `table` is that of the reference.

`python tools/material_plot.py`, from the top folder.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from spisim.scene.bsdf import BSDFS, Diffuse
from spisim.scene.materials import Material, find_material, shipped_materials

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "materials.png"
WAVELENGTHS_NM = (850, 905, 940, 1460, 1550)
GROUPS = {
    "Built": "concrete brick asphalt wood-dry steel-painted aluminium-brushed",
    "Grown and fallen": "leaves-green needles-green leaves-dry bark soil-field snow",
    "Worn and packed": "cotton-white polyester-fabric cardboard pvc rubber-black skin",
    "Dry (full) and soaked (dashed)": "concrete brick asphalt leaves-green",
}


def main() -> None:
    """Reflectance over wavelength of typical surfaces."""
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.6), layout="constrained", sharey=True)
    for axis, (title, names) in zip(axes, GROUPS.items(), strict=True):
        for i, name in enumerate(names.split()):
            _draw(axis, name, f"C{i}", "-", label=name)
            if "soaked" in title:
                _draw(axis, f"{name.removesuffix('-green')}-wet", f"C{i}", "--", label=None)
        axis.set(title=title, xlabel="wavelength / nm", ylim=(0, 1))
        axis.set_xticks([900, 1200, 1500])
        axis.legend(fontsize="small", framealpha=0.6)
    axes[0].set_ylabel("reflectance")
    figure.savefig(PICTURE, dpi=80)


def table() -> list[str]:
    """All materials as rows of Markdown."""
    header = "| material | 850 | 905 | 940 | 1460 | 1550 nm | typical at 1550 | model | source |"
    return [header, "|---|---|---|---|---|---|---|---|---|", *map(_row, shipped_materials().names)]


def _row(name: str) -> str:
    spectrum = [find_material(name, None, nm) for nm in WAVELENGTHS_NM]
    values = " | ".join(f"{material.reflectance:.2g}" for material in spectrum)
    shipped = shipped_materials()
    typical = None if name in shipped.wet else shipped.dry[name].typical
    between = "" if typical is None else "{:g} to {:g}".format(*typical)
    source = f"{shipped.wet[name]}, soaked" if name in shipped.wet else spectrum[-1].source
    return f"| `{name}` | {values} | {between} | {_model(spectrum[-1])} | {source} |"


def _model(material: Material) -> str:
    if isinstance(material.bsdf, Diffuse):
        return ""
    name = next(name for name, model in BSDFS.items() if isinstance(material.bsdf, model))
    roughness = getattr(material.bsdf, "roughness", None)
    return name if roughness is None else f"{name}, α = {roughness:g}"


def _draw(axis: plt.Axes, name: str, colour: str, style: str, label: str | None) -> None:
    values = np.array([find_material(name, None, nm).reflectance for nm in WAVELENGTHS_NM])
    # Between 940 and 1460 nm nothing is known.
    for part, displayed in ((slice(0, 3), label), (slice(3, 5), None)):
        marked = {"color": colour, "marker": "o", "markersize": 4, "label": displayed}
        axis.plot(WAVELENGTHS_NM[part], values[part], style, **marked)


if __name__ == "__main__":
    main()
