"""Draw the phasors of target and fog by frequency, the picture of docs/theory/ranging-in-fog.md.

`python tools/fog_phasors.py`, from the top folder.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.constants import c

from reconstruction.ranging.fog.modes import BACKSCATTER_PER_SR
from reconstruction.ranging.fog.overlap import overlap
from spisim.instrument import load_instrument

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "fog-phasors.png"
PRESET = "fog"
EXTINCTION_PER_M = 3.912 / 50 * 1.14  # 50 m of visibility, at 1550 nm
REFLECTANCE = 0.5
RANGES_M = np.arange(0.01, 9.0, 0.01)
MARKED_M = (4, 5, 6, 7)


def main() -> None:
    """One panel for each frequency: the fog's echo, the target's, and their sum over the range."""
    instrument = load_instrument(PRESET)
    weight, path_m = (each[0] for each in overlap(instrument.spot_optics, RANGES_M))
    damped = weight * np.exp(-EXTINCTION_PER_M * path_m)
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.2), layout="constrained")
    for axis, frequency_hz in zip(axes, instrument.tof.modulation.frequencies_hz, strict=True):
        turn = np.exp(2j * np.pi * frequency_hz / c * path_m)
        fog = np.cumsum(BACKSCATTER_PER_SR * EXTINCTION_PER_M * damped * turn) * 0.01
        target = REFLECTANCE / np.pi * damped * turn
        seen = (RANGES_M > 3.9) & (RANGES_M < 8.5)
        scale = 1 / abs(target[seen][0])
        fog, target = fog * scale, target * scale
        axis.plot(fog.real, fog.imag, color="C0", label="echo of the fog up to the target")
        for values, style, label in ((target, "C7--", "target alone"), (target + fog, "C3", "sum")):
            axis.plot(values[seen].real, values[seen].imag, style, label=label, linewidth=1)
        for metres in MARKED_M:
            at = np.searchsorted(RANGES_M, metres)
            both = np.array([target[at], target[at] + fog[at]])
            axis.plot(both.real, both.imag, color="0.8", linewidth=0.8, zorder=0)
            axis.plot(both[1].real, both[1].imag, "o", color="C3", markersize=4)
            axis.annotate(f"{metres} m", (both[1].real, both[1].imag), fontsize=8)
        axis.plot(0, 0, "k+")
        axis.set(title=f"{frequency_hz / 1e6:g} MHz", aspect="equal", xticks=[], yticks=[])
        axis.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25))
    axes[0].legend(fontsize="small", framealpha=0.6, loc="upper right")
    figure.savefig(PICTURE, dpi=90)


if __name__ == "__main__":
    main()
