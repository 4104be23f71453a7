"""Train black and white patterns through the instrument that will display them.

    pip install 'spisim[torch]'
    python examples/train_patterns.py patterns.npy IMAGES.npz ... [--instrument paper]

IMAGES.npz have `image` (n, H, W), transport images as `tools/drawn_images.py` and
`tools/dead_leaves.py` write them; every file counts the same. Each step displays the patterns and
their complements, draws noisy readings of some images, estimates these images, and moves the
patterns down the gradient of the log of the squared error, through estimate, noise and readings.
Images are turned over and moved at random, so that no pattern learns where things stood.
The first pattern is all on; the others begin as those of the order `variance-ranked`. Patterns are
rounded to black and white in every step, and the gradient passes the rounding.

`patterns.npy` goes into an instrument's `patterns_file`; `patterns.json` beside it says what they
were trained on.
"""

import argparse
import hashlib
import json
import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from reconstruction.base.arrays import Floats
from reconstruction.image.dictionaries.dct import DICTIONARY
from reconstruction.image.methods.fitted_covariance import fitted_sigma
from reconstruction.image.prior import RELATIVE, SPREAD
from reconstruction.operators import make_plan
from spisim.instrument import load_instrument
from spisim_inverse.layers import ReadingModel
from spisim_inverse.layers.for_torch import black_and_white, expected_readings, noisy_readings

POWERS = (1.0, 0.5, 1.5, 2.0)
"""Of the variance of cosines: images are flatter and steeper than their mean."""
CONTRASTS = np.linspace(-9.0, 4.5, 28)
"""Logarithms of the variances of pixels, relative to the squared mean, that are weighed."""
RATE, START, JITTER = 0.03, 0.1, 0.01
"""Step of Adam, and distance of the first patterns from grey, with its scatter."""
REPORTED = 20
SEED = 0


def main() -> None:
    """Train, and write patterns and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("patterns_file", type=Path)
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--instrument", default="paper")
    parser.add_argument("--patterns", type=int, default=127)
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    asked = parser.parse_args()
    torch.manual_seed(SEED)
    held = [np.load(file) for file in asked.images]
    files = [torch.tensor(each["image"], dtype=torch.float32) for each in held]
    sets = [some[some.std(dim=(1, 2)) > 0].to(asked.device) for some in files]
    model = ReadingModel.of(load_instrument(asked.instrument))
    patterns = trained(model, sets, asked.patterns, asked.steps, asked.batch)
    np.save(asked.patterns_file, patterns)
    manifest = {
        "instrument": asked.instrument,
        "families": sorted({str(name) for each in held for name in each.get("family", ())}),
        "images": {
            file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in asked.images
        },
        "patterns": asked.patterns,
        "steps": asked.steps,
        "batch": asked.batch,
    }
    text = json.dumps(manifest, indent=2) + "\n"
    asked.patterns_file.with_suffix(".json").write_text(text)


def trained(
    model: ReadingModel, sets: list[Tensor], patterns: int, steps: int, batch: int
) -> Floats:
    """Patterns (K, H, W) of 0 and 1 that serve sets of transport images (n, H, W) best."""
    shape = tuple(sets[0].shape[1:])
    plan = make_plan(shape, patterns, "variance-ranked", "signed")
    rows = torch.tensor(plan.patterns.matrix(plan.index), dtype=torch.float32)[1:]
    rows = rows.reshape(-1, *shape).to(sets[0])
    free = (START * rows + JITTER * torch.randn_like(rows)).requires_grad_()
    decoder = Decoder(shape, sets[0])
    optimiser = torch.optim.Adam([free], lr=RATE, betas=(0.9, 0.99))
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps, RATE / 30)
    for step in range(steps):
        images = torch.cat([moved(some[torch.randint(len(some), (batch,))]) for some in sets])
        binary = displayed(free)
        estimate = decoder(model, binary, images)
        error = ((estimate - images) ** 2).mean(dim=(1, 2)) / images.var(dim=(1, 2))
        loss = torch.log(error + 1e-3).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        if step % REPORTED == REPORTED - 1:
            print(
                f"step {step + 1} of {steps}: {10 / math.log(10) * loss.item():.2f} dB", flush=True
            )
    return np.asarray(displayed(free).detach().cpu(), dtype=np.uint8)


def moved(images: Tensor) -> Tensor:
    """Images (B, H, W), mirrored at their edges, each from another position."""
    wide = torch.cat([images, images.flip(2)], dim=2)
    endless = torch.cat([wide, wide.flip(1)], dim=1)
    height, width = images.shape[1:]
    result = []
    for image in endless:
        down, along = (int(torch.randint(2 * side, ())) for side in (height, width))
        result.append(torch.roll(image, (down, along), (0, 1))[:height, :width])
    return torch.stack(result)


def displayed(free: Tensor) -> Tensor:
    """Patterns of 0 and 1, the first all on, from numbers around 0."""
    rounded = black_and_white((free.clamp(-1, 1) + 1) / 2)
    return torch.cat([torch.ones_like(rounded[:1]), rounded])


class Decoder:
    """Readings, and the mean image given them: Gaussian in the cosines of images of `shape`.

    Contrast and steepness of the spectrum are averaged over as readings make them probable; see
    `reconstruction.image.contrast`.
    """

    def __init__(self, shape: tuple[int, int], like: Tensor) -> None:
        self.vertical, self.horizontal = (
            torch.tensor(DICTIONARY.atoms(side)).to(like) for side in shape
        )
        powers = fitted_sigma(shape).ravel() ** (2 * np.array(POWERS)[:, None])
        powers *= powers.shape[1] / powers.sum(axis=1, keepdims=True)
        self.variance = torch.tensor(powers).to(like)
        self.logs = torch.tensor(CONTRASTS).to(like)

    def __call__(self, model: ReadingModel, patterns: Tensor, images: Tensor) -> Tensor:
        """Images (B, H, W) as estimated from noisy readings of patterns (K, H, W) on them."""
        pairs = torch.stack([patterns, 1 - patterns], dim=1).flatten(0, 1)
        mean = expected_readings(model, pairs, images)
        light = noisy_readings(model, mean, torch.randn_like(mean))
        values = light[:, ::2] - light[:, 1::2]
        variance = model.excess_noise_factor * mean + model.noise_electrons**2
        # In units of the electrons of the mean pixel.
        scale = torch.tensor(model.electrons).to(images).mean() * images.mean(dim=(1, 2))[:, None]
        noise = 2 * variance.mean(dim=1, keepdim=True) / scale**2
        spectrum = self._mean(2 * patterns - 1, values / scale, noise)
        estimate = self.vertical @ spectrum @ self.horizontal.T
        return estimate * images.mean(dim=(1, 2))[:, None, None]

    def _mean(self, rows: Tensor, values: Tensor, noise: Tensor) -> Tensor:
        """Spectra (B, H, W), given values (B, K) with noise of this variance (B, 1)."""
        seen = (self.vertical.T @ rows @ self.horizontal).flatten(1)
        constant = seen[:, 0] / seen[0, 0]
        level = values[:, :1] / seen[0, 0]
        varying, left = seen[1:], values[:, 1:] - constant[1:] * values[:, :1]
        weighed = varying * self.variance[:, None]  # (P, K - 1, N)
        covariance = weighed @ varying.T
        of_noise = torch.eye(len(varying)).to(rows) + torch.outer(constant[1:], constant[1:])
        contrast, probability = self._contrasts(left, covariance, of_noise, noise)
        factor = torch.linalg.cholesky(
            contrast[:, :, None, None] * covariance + noise[:, :, None, None] * of_noise
        )
        solved = torch.cholesky_solve(left[:, None, :, None].expand(*factor.shape[:3], 1), factor)
        weights = (probability * contrast)[:, :, None] * solved[..., 0]
        spectrum = weights.flatten(1) @ weighed.flatten(0, 1)
        spectrum = torch.cat([level, spectrum[:, 1:]], dim=1)
        return spectrum.reshape(-1, len(self.vertical), len(self.horizontal))

    @torch.no_grad()
    def _contrasts(
        self, values: Tensor, covariance: Tensor, of_noise: Tensor, noise: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Mean contrast of each spectrum (B, P), and the spectra's probabilities."""
        root = torch.linalg.cholesky(of_noise)
        half = torch.linalg.solve_triangular(root, covariance, upper=False)
        white = torch.linalg.solve_triangular(root, half.mT, upper=False)
        spread, turn = torch.linalg.eigh(white)
        turn = torch.linalg.solve_triangular(root.T, turn, upper=True)
        power = torch.einsum("pkj,bk->bpj", turn, values)[:, :, None] ** 2
        variance = self.logs.exp()[:, None] * spread.clamp(min=0)[:, None] + noise[..., None, None]
        density = -(variance.log() + power / variance).sum(dim=-1) / 2
        density -= ((self.logs - 2 * math.log(RELATIVE)) / (2 * SPREAD)) ** 2 / 2
        contrast = (torch.softmax(density, dim=-1) * self.logs.exp()).sum(dim=-1)
        return contrast, torch.softmax(torch.logsumexp(density, dim=-1), dim=-1)


if __name__ == "__main__":
    main()
