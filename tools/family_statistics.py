"""What the families of scenes are like: depths, sky, spectra of images, and how alike seeds are.

    python tools/family_statistics.py [DOCS] [--seeds 0 24] [--families NAME ...]

Draws every family and casts rays through it. The image is that of direct light, reflectance times
cosine over squared range, as a projector beside the detector makes it; the one in even daylight,
reflectance alone and a sky twice as bright as white, is what photographs of natural scenes compare
with. Writes the table between the marks of DOCS/scenes.md and DOCS/images/families.png.
"""

import argparse
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reconstruction.base.arrays import Floats
from reconstruction.base.files import write_atomically
from spisim.scene import Scene, draw_scene
from spisim.scene.bsdf import ThinPane
from spisim.scene.families import FAMILIES
from spisim.scene.layout import OFFERED
from spisim_app.report.style import file_of, plot_style
from spisim_paper.checks import Table, around_marks

DOCS = Path(__file__).parents[1] / "docs"
#: Pixels of an image each way, and rays through each, each way.
PIXELS, FINE = 64, 3
SKY = 2.0
#: What is farther counts as far, m, and the range of a spot of the paper's instrument.
FAR_M = 100.0
#: Cycles per image between which the slope of a spectrum is fitted.
BAND = (2, 24)
#: Power of natural images falls as frequency to this: mean and deviation of 276 images, van der
#: Schaaf & van Hateren (1996), Vision Research 36, 2759; Field (1987), J. Opt. Soc. Am. A 4, 2379,
#: has 2.0, Ruderman (1997), Vision Research 37, 3385, 1.81.
NATURAL = (1.88, 0.43)
MARKS = "statistics"


@dataclass(frozen=True)
class View:
    """What a drone sees: images (PIXELS, PIXELS), ranges of pixels and of spots, inf for sky."""

    lit: Floats
    daylit: Floats
    range_m: Floats
    spots_m: Floats


def main(docs: Path, seeds: range, names: list[str]) -> None:
    """Draw, and write table and figure."""
    warnings.simplefilter("ignore")
    views: dict[str, list[View]] = {}
    for name in names:
        print(name, file=sys.stderr)
        views[name] = [view(draw_scene(name, seed)) for seed in seeds]
    page = docs / "results" / "scenes.md"
    before, after = around_marks(page, MARKS)
    rows = [_row(name, views[name]) for name in names]
    columns = (
        "family", "depth, m: 5 %", "50 %", "95 %", f"beyond {FAR_M:.0f} m", "sky", "most sky",
        "spots that return", "spread of log range", "nearest seed", "slope, lit", "slope, daylight",
    )  # fmt: skip
    table = Table("", columns, rows).markdown().lstrip("\n")
    write_atomically(page, f"{before}\n\n{table}\n{after}".encode())
    with plot_style():
        write_atomically(docs / "images" / "families.png", file_of(_figure(views), "png"))


def view(scene: Scene) -> View:
    """Cast rays through the pixels and the spots; panes are looked through."""
    things = [thing for thing in scene.objects if not isinstance(thing.material.bsdf, ThinPane)]
    triangles = np.concatenate([thing.mesh.triangles for thing in things])
    triangles = (triangles - scene.drone_pose[:3, 3]) @ scene.drone_pose[:3, :3]
    owner = np.repeat(np.arange(len(things)), [len(thing.mesh.faces) for thing in things])
    reflectances = np.array([thing.material.reflectance for thing in things])
    across = 2 * (np.arange(PIXELS * FINE) + 0.5) / (PIXELS * FINE) - 1
    x, y = np.meshgrid(*(np.tan(np.radians(half)) * across for half in OFFERED.half_field_deg))
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    rays = np.vstack([rays / np.linalg.norm(rays, axis=1, keepdims=True), OFFERED.beams])
    faces = np.arange(3 * len(triangles)).reshape(-1, 3)
    world = trimesh.Trimesh(triangles.reshape(-1, 3), faces, process=False)
    met = world.ray.intersects_first(np.zeros_like(rays), rays)
    hit = met >= 0
    a, b, c = np.moveaxis(triangles[met], 1, 0)
    normal = np.cross(b - a, c - a)
    slant = np.einsum("nk,nk->n", normal, rays)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = np.where(hit, np.einsum("nk,nk->n", normal, a) / slant, np.inf)
        cosine = np.abs(slant) / np.linalg.norm(normal, axis=1)
        lit = np.where(hit, reflectances[owner[met]] * cosine / range_m**2, 0.0)
    daylit = np.where(hit, reflectances[owner[met]], SKY)
    middle = range_m[:-4].reshape(PIXELS, FINE, PIXELS, FINE)[:, FINE // 2, :, FINE // 2]
    return View(_pixels(lit[:-4]), _pixels(daylit[:-4]), middle, range_m[-4:])


def slope(images: list[Floats]) -> Floats:
    """Exponent with which each image's power falls with frequency, by a line in its logarithms."""
    frequency, power = spectra(images)
    fitted = (frequency >= BAND[0]) & (frequency <= BAND[1])
    flat = power[:, fitted].min(axis=1) > 0
    return -np.polyfit(np.log(frequency[fitted]), np.log(power[flat][:, fitted]).T, 1)[0]


def spectra(images: list[Floats]) -> tuple[Floats, Floats]:
    """Frequencies (f,) in cycles per image, and power (n, f) averaged over directions."""
    window = np.hanning(PIXELS + 2)[1:-1]
    retained = np.array([image / image.mean() - 1 for image in images if image.mean() > 0])
    power = np.abs(np.fft.fft2(retained * np.outer(window, window))) ** 2
    along = np.fft.fftfreq(PIXELS, 1 / PIXELS)
    ring = np.rint(np.hypot(*np.meshgrid(along, along))).astype(int).ravel()
    count = np.bincount(ring)
    rings = np.array([np.bincount(ring, each.ravel()) / count for each in power])
    inside = np.arange(1, PIXELS // 2)
    return inside.astype(float), rings[:, inside]


def nearest_correlation(images: list[Floats]) -> Floats:
    """Of each image with the one of another seed that is most like it."""
    flat = np.array([image.ravel() for image in images])
    flat = flat - flat.mean(axis=1, keepdims=True)
    norms = np.linalg.norm(flat, axis=1, keepdims=True)
    flat = np.divide(flat, norms, out=np.zeros_like(flat), where=norms > 0)
    like = flat @ flat.T
    np.fill_diagonal(like, -1)
    return np.asarray(like.max(axis=1))


def spread(views: list[View]) -> Floats:
    """Standard deviation of the logarithm of range, of the spots that meet anything; in each."""
    result = [np.log(one.spots_m[np.isfinite(one.spots_m)]) for one in views]
    return np.array([np.std(logs) for logs in result if len(logs) > 1])


def _pixels(values: Floats) -> Floats:
    return values.reshape(PIXELS, FINE, PIXELS, FINE).mean(axis=(1, 3))


def _row(name: str, views: list[View]) -> tuple[str, ...]:
    ranges = np.concatenate([one.range_m.ravel() for one in views])
    finite = ranges[np.isfinite(ranges)]
    sky = np.array([np.isinf(one.range_m).mean() for one in views])
    spots = np.array([(one.spots_m <= OFFERED.farthest_spot_m).sum() for one in views])
    lit, daylit = ([getattr(one, kind) for one in views] for kind in ("lit", "daylit"))
    return (
        name,
        *(f"{value:.3g}" for value in np.quantile(finite, (0.05, 0.5, 0.95))),
        f"{np.mean(finite > FAR_M):.0%}",
        f"{sky.mean():.0%}",
        f"{sky.max():.0%}",
        f"{spots.mean():.1f}",
        f"{np.median(spread(views)):.2f}",
        f"{np.median(nearest_correlation(lit)):.2f}",
        *(f"{value.mean():.2f} ± {value.std():.2f}" for value in (slope(lit), slope(daylit))),
    )


def _figure(views: dict[str, list[View]]) -> Figure:
    """Depths, sky and likeness by family, and spectra of all."""
    names = list(views)
    sheet = Figure(figsize=(11, 8.2), layout="constrained")
    (depths, sky), (likeness, spectrum) = sheet.subplots(2, 2)
    ranges = [np.concatenate([one.range_m.ravel() for one in views[name]]) for name in names]
    edges = np.geomspace(0.8, 12_000, 60)
    fractions = np.array([np.histogram(each, edges)[0] / each.size for each in ranges])
    is_open = np.array([FAMILIES[name].min_spots < len(OFFERED.beams) for name in names])
    for chosen, label in ((~is_open, "closed"), (is_open, "open")):
        if chosen.any():
            depths.stairs(fractions[chosen].mean(axis=0), edges, label=f"{label} families", lw=1.6)
    depths.set(xscale="log", xlabel="true range, m", ylabel="fraction of pixels")
    depths.axvline(OFFERED.farthest_spot_m, color="0.5", ls=":", label="unambiguous")
    depths.legend()
    displayed = [np.array([np.isinf(one.range_m).mean() for one in views[n]]) for n in names]
    _boxes(sky, names, displayed)
    sky.set(ylabel="fraction of sky", ylim=(-0.02, 1))
    _boxes(likeness, names, [nearest_correlation([one.lit for one in views[n]]) for n in names])
    likeness.axhline(0.6, color="0.5", ls=":")
    likeness.set(ylabel="correlation with the nearest seed", ylim=(0, 1))
    for kind, label in (("lit", "lit by the projector"), ("daylit", "in even daylight")):
        images = [getattr(one, kind) for name in names for one in views[name]]
        frequency, power = spectra(images)
        usual = np.exp(np.log(power[power.min(axis=1) > 0]).mean(axis=0))
        spectrum.loglog(frequency, usual / usual[3], label=label, lw=1.6)
    mean, sigma = NATURAL
    for exponent, style in ((mean, "-"), (mean + sigma, ":"), (mean - sigma, ":")):
        line = (frequency / frequency[3]) ** -exponent
        spectrum.loglog(frequency, line, color="0.5", ls=style, lw=1)
    spectrum.plot([], [], color="0.5", lw=1, label="natural scenes: 1.88 ± 0.43")
    spectrum.set(xlabel="cycles per image", ylabel="power, relative")
    spectrum.legend()
    return sheet


def _boxes(axis: Axes, names: list[str], values: list[Floats]) -> None:
    axis.boxplot(values, widths=0.6, flierprops={"markersize": 2})
    axis.set_xticks(range(1, len(names) + 1), names, rotation=90, fontsize=7)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("docs", nargs="?", type=Path, default=DOCS, help="folder of the pages")
    parser.add_argument("--seeds", type=int, nargs=2, default=(0, 24), metavar="N")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), metavar="NAME")
    asked = parser.parse_args()
    main(asked.docs, range(*asked.seeds), asked.families)
