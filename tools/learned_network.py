"""Train the network of the image method `learned`, on the pairs of `tools/image_pairs.py`.

    pip install 'spisim[torch]'
    python tools/learned_network.py FOLDER WEIGHTS.npz [--steps 20000]

The loss is the squared error over that of the image which the network is shown, so that every image
counts the same, and more where the network makes it worse; the deviation is fitted by
maximum likelihood. Every 20th chunk is kept aside. Beside the weights, a JSON file of their name
tells what they were trained on, and what they gain on the chunks kept aside.
"""

import argparse
import hashlib
import json
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import pixel_shuffle, pixel_unshuffle

from reconstruction.base.arrays import Floats
from reconstruction.image.network import VERSION, NetworkInput

SEED = 7
BATCH = 16
RATE = 1.5e-3
NARROW, WIDE = 16, 48
"""Channels at half and at a quarter of the resolution."""
ASIDE = 20
MIN_ERROR = 1e-4
"""Squared, over that of the contrast: a better image is good enough."""
WORSE = 3.0
"""Weight of what makes an image worse, besides that of all errors."""
OF_SIGMA = 0.1
"""Weight of sigma in the loss."""
USUAL = 0.02, 99.98
"""Percentiles of what is like the pairs learned from."""
FARTHEST = 6.0
"""Maximum error over sigma: one pixel does not decide."""
LARGEST = 30.0
"""Mean square of the truth over that of the contrast: of more, noise hides all of it."""
INVERTED = 0.2
"""Share of batches that are learned from as negatives."""
AVERAGED = 0.999


class Net(nn.Module):
    """As `reconstruction.image.network` evaluates it."""

    def __init__(self) -> None:
        super().__init__()
        self.enter = nn.Conv2d(4 * 3 + 2, NARROW, 3, padding=1)
        self.before = nn.Conv2d(NARROW, NARROW, 3, padding=1)
        self.down = nn.Conv2d(4 * NARROW, WIDE, 1)
        self.wide = nn.ModuleList(nn.Conv2d(WIDE, WIDE, 3, padding=1) for _ in range(4))
        self.up = nn.Conv2d(WIDE, 4 * NARROW, 1)
        self.after = nn.Conv2d(NARROW, NARROW, 3, padding=1)
        self.leave = nn.Conv2d(NARROW, 4 * 2, 3, padding=1)
        nn.init.zeros_(self.leave.weight)
        nn.init.zeros_(self.leave.bias)

    def forward(self, maps: Tensor, numbers: Tensor) -> Tensor:
        """Correction over sigma, and log of sigma over the one of the input: (B, 2, H, W)."""
        half = pixel_unshuffle(maps, 2)
        constant = numbers[:, :, None, None].expand(-1, -1, *half.shape[2:])
        retained = torch.relu(self.enter(torch.cat([half, constant], dim=1)))
        retained = torch.relu(self.before(retained))
        quarter = torch.relu(self.down(pixel_unshuffle(retained, 2)))
        for first, second in zip(self.wide[::2], self.wide[1::2], strict=True):
            quarter = quarter + second(torch.relu(first(quarter)))
        retained = torch.relu(retained + pixel_shuffle(self.up(quarter), 2))
        return pixel_shuffle(self.leave(torch.relu(self.after(retained))), 2)


class Pairs:
    """Everything that is learned from, by shape of image, as tensors."""

    def __init__(self, files: list[Path]) -> None:
        features = []
        result: dict[tuple[int, ...], list[tuple[Floats, ...]]] = defaultdict(list)
        for file in files:
            archive = np.load(file)
            displayed = [
                NetworkInput(*each)
                for each in zip(
                    archive["first"],
                    archive["better"],
                    archive["deviation"],
                    archive["share"],
                    archive["noise"],
                    strict=True,
                )
            ]
            maps = np.array([each.maps() for each in displayed])
            numbers = np.array([each.numbers() for each in displayed])
            columns = maps, numbers, archive["better"], archive["deviation"], archive["truth"]
            visible = (archive["truth"] ** 2).mean(axis=(1, 2)) < LARGEST
            features += [
                each.features() for each, seen in zip(displayed, visible, strict=True) if seen
            ]
            result[archive["truth"].shape[1:]].append(tuple(column[visible] for column in columns))
        self.groups = [
            [torch.from_numpy(np.concatenate(column)) for column in zip(*each, strict=True)]
            for each in result.values()
        ]
        self.limits = np.percentile(features, [*USUAL], axis=0).astype(np.float32)
        """Of what makes a frame like these."""
        self.sizes = np.array([len(group[0]) for group in self.groups])

    def batch(self, rng: np.random.Generator) -> list[Tensor]:
        """Some of one shape, turned over or not, and some negative."""
        group = self.groups[rng.choice(len(self.groups), p=self.sizes / self.sizes.sum())]
        chosen = torch.from_numpy(rng.integers(len(group[0]), size=BATCH))
        columns = [column[chosen] for column in group]
        axes = [axis for axis in (-2, -1) if rng.random() < 0.5]
        maps, numbers, better, sigma, truth = (
            column.flip(axes) if column.dim() > 2 and axes else column for column in columns
        )
        if rng.random() < INVERTED:
            sign = torch.tensor([-1.0, -1.0, 1.0])[:, None, None]
            maps, better, truth = maps * sign, -better, -truth
        return [maps, numbers, better, sigma, truth]


def loss_of(out: Tensor, better: Tensor, sigma: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """The loss, and the squared error over that of the better image, of each (B,)."""
    image = better + sigma * out[:, 0]
    before = ((better - truth) ** 2).mean(dim=(1, 2)) + MIN_ERROR
    ratio = (((image - truth) ** 2).mean(dim=(1, 2)) + MIN_ERROR) / before
    error = ((image.detach() - truth) / torch.clamp(sigma, min=1e-3)).clamp(-FARTHEST, FARTHEST)
    unlikely = out[:, 1] + error**2 * torch.exp(-2 * out[:, 1]) / 2
    worse = torch.relu(ratio - 1)
    return (ratio + WORSE * worse + OF_SIGMA * unlikely.mean(dim=(1, 2))).mean(), ratio


def main() -> None:
    """Train, and write weights and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--steps", type=int, default=20000)
    parser.add_argument("--start", type=Path, help="weights to begin with")
    asked = parser.parse_args()
    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    files = sorted(file for file in asked.folder.glob("*.npz") if "part" not in file.name)
    train, aside = Pairs([f for n, f in enumerate(files) if n % ASIDE]), Pairs(files[::ASIDE])
    net = trained(train, aside, asked.steps, asked.start)
    weights = {name: value.half().numpy() for name, value in net.state_dict().items()}
    np.savez(asked.weights, version=VERSION, limits=train.limits, **weights)
    manifest = {
        "chunks": len(files),
        "pairs": int(train.sizes.sum()),
        "steps": asked.steps,
        "start": asked.start and hashlib.sha256(asked.start.read_bytes()).hexdigest(),
        "seed": SEED,
        "sha256": hashlib.sha256(asked.weights.read_bytes()).hexdigest(),
        "gain_db_aside": gain_db(net, aside),
    }
    asked.weights.with_suffix(".json").write_text(json.dumps(manifest, indent=2) + "\n")


def trained(train: Pairs, aside: Pairs, steps: int, start: Path | None) -> Net:
    """The mean of the weights over the last thousand steps or so."""
    rng = np.random.default_rng(SEED)
    net = Net()
    if start is not None:
        archive = np.load(start)
        weights = {name: torch.from_numpy(archive[name]).float() for name in net.state_dict()}
        net.load_state_dict(weights)
    net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    mean = torch.optim.swa_utils.AveragedModel(
        net, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(AVERAGED)
    )
    optimiser = torch.optim.Adam(net.parameters(), lr=RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, steps, pct_start=0.05)
    begun = time.perf_counter()
    for step in range(steps):
        maps, numbers, *rest = train.batch(rng)
        loss, _ = loss_of(net(_last(maps), numbers), *rest)
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        mean.update_parameters(net)
        if step % 500 == 499:
            gains = gain_db(mean.module, aside)
            print(f"{step + 1} steps, {time.perf_counter() - begun:.0f} s: {gains}", flush=True)
    retained = mean.module
    assert isinstance(retained, Net)
    return retained


def _last(maps: Tensor) -> Tensor:
    """Channels last, which is faster."""
    return maps.contiguous(memory_format=torch.channels_last)


@torch.no_grad()
def gain_db(net: nn.Module, aside: Pairs) -> dict[str, float]:
    """Over the image that the network is shown: mean, and the least but for 1 %."""
    ratios = []
    for maps, numbers, *rest in aside.groups:
        ratios.append(loss_of(net(_last(maps), numbers), *rest)[1])
    gains = -10 * torch.log10(torch.cat(ratios)).numpy()
    return {"mean": float(gains.mean()), "percentile_1": float(np.percentile(gains, 1))}


if __name__ == "__main__":
    main()
