"""Train black and white patterns for Gaussian images of several covariances, without samples.

    pip install 'spisim[torch]'
    python tools/trained_patterns.py patterns.npy [--steps 120]

The loss of `examples/train_patterns.py` in closed form: the expected squared error of the
least-squares estimate from noisy readings, of images with the covariance of `fitted-covariance`,
which is fitted to drawn scenes and dead leaves, and flatter and steeper ones, at several ratios of
signal to noise. The mean of its logarithms falls down its gradient, through a rounding to black and
white. Nothing is learned of where things stand. `patterns.npy` are bits (patterns, pixels / 8).
"""

import argparse
import json
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from reconstruction.base.arrays import Floats
from reconstruction.image.dictionaries.dct import DICTIONARY
from reconstruction.image.methods.fitted_covariance import FITTED, fitted_sigma
from reconstruction.operators import make_plan
from spisim_inverse.layers.for_torch import black_and_white

PATTERNS = 127
SHAPE = (64, 64)
POWERS = (1.0, 0.5, 1.5)
"""Of the variance of cosines: images are flatter and steeper than their mean."""
SNR = (0.35, 1.0, 3.0)
"""Signal over noise of a coefficient, if the images were white."""
RATE, START, JITTER, SEED = 0.03, 0.1, 0.01, 1
"""Step of Adam; distance of the first patterns from grey, its scatter, and the seed of that."""


def main() -> None:
    """Train, and write patterns and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("patterns_file", type=Path)
    parser.add_argument("--steps", type=int, default=120)
    asked = parser.parse_args()
    patterns = trained(variances(SHAPE), asked.steps)
    np.save(asked.patterns_file, np.packbits(patterns.reshape(len(patterns), -1), axis=1))
    covariance = json.loads(FITTED.read_text())
    manifest = {
        "families": covariance.pop("families"),
        "covariance": covariance,
        "powers": POWERS,
        "snr": SNR,
        "patterns": PATTERNS,
        "steps": asked.steps,
    }
    text = json.dumps(manifest, indent=2) + "\n"
    asked.patterns_file.with_suffix(".json").write_text(text)


def variances(shape: tuple[int, int]) -> Floats:
    """Variances (P, H, W) of cosines, 0 for the constant, of mean 1."""
    powers = np.array([fitted_sigma(shape) ** (2 * power) for power in POWERS])
    return np.asarray(powers / powers.mean(axis=(1, 2), keepdims=True))


def trained(powers: Floats, steps: int) -> Floats:
    """Patterns (K, H, W) of 0 and 1, the first all on."""
    shape = powers.shape[1:]
    plan = make_plan(shape, PATTERNS, "variance-ranked", "signed")
    rows = plan.patterns.matrix(plan.index)[1:].reshape(-1, *shape)
    jitter = JITTER * np.random.default_rng(SEED).standard_normal(rows.shape)
    free = torch.tensor(START * rows + jitter, dtype=torch.float32, requires_grad=True)
    optimiser = torch.optim.Adam([free], lr=RATE, betas=(0.9, 0.99))
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps, RATE / 30)
    error = ExpectedError(powers)
    for step in range(steps):
        loss = error(2 * black_and_white((free.clamp(-1, 1) + 1) / 2) - 1)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        if step % 10 == 9:
            print(f"step {step + 1} of {steps}: {10 * loss.item() / np.log(10):.3f} dB", flush=True)
    signs = np.asarray(free.detach()) >= 0
    return np.concatenate([np.ones((1, *shape), bool), signs]).astype(np.uint8)


class ExpectedError:
    """Logarithm of the squared error that linear estimates leave of the images' variance."""

    def __init__(self, powers: Floats) -> None:
        self._atoms = [
            torch.tensor(DICTIONARY.atoms(side), dtype=torch.float32) for side in powers.shape[1:]
        ]
        self._variance = torch.tensor(powers, dtype=torch.float32).flatten(1)[:, None]
        self._pixels = self._variance.shape[-1]
        self._noise = self._pixels / torch.tensor(SNR)[:, None, None] ** 2

    def __call__(self, rows: Tensor) -> Tensor:
        """Mean over variances and noises, for rows (K, H, W) of -1 and 1 beside the level."""
        seen = (self._atoms[0].T @ rows @ self._atoms[1]).flatten(1)
        level = seen[:, 0] / self._pixels**0.5  # the level is subtracted, with its noise
        varying = torch.cat([torch.zeros_like(seen[:, :1]), seen[:, 1:]], dim=1)
        noise = self._noise * (torch.eye(len(rows)) + torch.outer(level, level))
        logs = []
        for variance in self._variance:
            weighed = varying * variance
            factor = torch.linalg.cholesky(weighed @ varying.T + noise)
            known = torch.linalg.solve_triangular(
                factor, weighed.expand(len(noise), -1, -1), upper=False
            )
            logs.append(torch.log(1 - known.square().sum(dim=(1, 2)) / self._pixels).mean())
        return torch.stack(logs).mean()


if __name__ == "__main__":
    main()
