"""A laboratory's first hour: its own patterns, its own taps, its own instrument.

    python lab.py

Run in an empty folder. Only the installed packages and their commands are used; raises
AssertionError where a figure is not what the closed form says.
"""

import json
import shlex
import subprocess
import sys

import numpy as np
from scipy.constants import c

import reconstruction
from spisim.instrument import load_instrument

SIDE, NOISE, COUNTS = 16, 30.0, 2.0
SPOTS_M = np.array([1.5, 2.2, 3.1, 4.4])
FREQUENCY_HZ = 20e6
BACKGROUND, AMPLITUDE = 60_000.0, 25_000.0  # electrons of a tap: mean, and its change with phase


def run(command: str) -> str:
    """Output of a command of this environment."""
    words = [sys.executable, "-m", *shlex.split(command)]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{command}\n{done.stderr}")
    return done.stdout


def image_of_own_patterns(rng: np.random.Generator) -> None:
    """Patterns and readings in text files -> image with its standard deviation."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    truth = 40 + 60 * np.exp(-((x - 0.4) ** 2 + (y - 0.6) ** 2) / 0.03)  # electrons of a pixel
    patterns = rng.integers(0, 2, (2 * SIDE**2, SIDE**2))
    light = patterns @ truth.ravel()
    counts = np.rint((rng.poisson(light) + NOISE * rng.standard_normal(light.size)) / COUNTS)
    np.savetxt("patterns.csv", patterns, fmt="%d", delimiter=",")
    np.savetxt("readings.csv", counts, fmt="%d")
    run(
        f"reconstruction import readings.csv --patterns-variable patterns.csv -o image.h5 "
        f"--shape {SIDE}x{SIDE} --electrons-per-count {COUNTS} --offset-counts 0 "
        f"--noise-electrons {NOISE} --excess-noise-factor 1"
    )
    run("reconstruction image.h5 -o image")
    result = reconstruction.read_result("image/result.h5")
    name = next(name for name in result.images if name in result.sigmas)
    image, sigma = result.images[name], result.sigmas[name]
    # Random patterns with no all-on reading do not tell the mean.
    error = (image - image.mean()) - (truth - truth.mean())
    correlation = np.corrcoef(image.ravel(), truth.ravel())[0, 1]
    within = np.mean(np.abs(error) < 2 * sigma)
    print(f"image {name}: correlation {correlation:.3f}, {100 * within:.0f} % within two sigma")
    assert correlation > 0.9
    assert within > 0.85


def range_of_own_taps(rng: np.random.Generator) -> None:
    """Taps in a text file -> ranges whose sigma is that of the closed form.

    c / (4 pi f) sqrt(v / 2) / A, with the variance v of a tap and the amplitude A of its signal
    (Lange & Seitz, IEEE J. Quantum Electron. 37, 390 (2001)).
    """
    phase = 4 * np.pi * FREQUENCY_HZ / c * SPOTS_M[:, None]
    light = BACKGROUND + AMPLITUDE * np.cos(phase - np.arange(4) * np.pi / 2)
    counts = (rng.poisson(light) + NOISE * rng.standard_normal(light.shape)) / COUNTS
    np.savetxt("taps.csv", np.rint(counts), fmt="%d", delimiter=",")
    run(
        f"reconstruction import --taps taps.csv --frequency {FREQUENCY_HZ:g} -o ranges.h5 "
        f"--taps-electrons-per-count {COUNTS} --taps-noise-electrons {NOISE}"
    )
    report = json.loads(run("reconstruction ranges.h5 -o ranges --ranging cw --json"))
    closed_m = c / (4 * np.pi * FREQUENCY_HZ) * np.sqrt((BACKGROUND + NOISE**2) / 2) / AMPLITUDE
    for spot, true_m in zip(report["spots"]["cw"], SPOTS_M, strict=True):
        range_m, sigma_m = spot["range_m"], spot["sigma_m"]
        print(f"range {range_m:.3f} m of {true_m} m, sigma {1e3 * sigma_m:.2f} mm", end="; ")
        print(f"closed form {1e3 * closed_m:.2f} mm")
        assert abs(range_m - true_m) < 5 * sigma_m
        assert abs(sigma_m / closed_m - 1) < 0.03


def own_instrument() -> None:
    """Data sheet -> instrument file -> budget -> capture -> image and ranges."""
    run("spisim instrument new -o mine.yaml --defaults --field-deg 15")
    run("spisim instrument new -o camera.yaml --defaults --makes image")
    run("spisim instrument new -o ranger.yaml --defaults --makes ranges")
    for name in ("mine", "camera", "ranger"):
        budget = json.loads(run(f"spisim budget {name}.yaml --range 3 --json"))
        assert (budget["image"] is None) == (name == "ranger")
        assert (budget["range"] is None) == (name == "camera")
        run(f"spisim simulate warehouse --instrument {name}.yaml -o {name}.h5 --spp 8")
        report = json.loads(run(f"reconstruction {name}.h5 -o {name} --json"))
        print(f"{name}: {load_instrument(f'{name}.yaml')!r}".replace("\n", ";"))
        assert bool(report["spots"]) == (name != "camera")
        assert name == "ranger" or report["pixels"] == 64**2


if __name__ == "__main__":
    draws = np.random.default_rng(7)
    image_of_own_patterns(draws)
    range_of_own_taps(draws)
    own_instrument()
