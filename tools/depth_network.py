"""Train the network of the depth method `learned`, on the frames of `tools/depth_frames.py`.

    pip install 'spisim[torch]'
    python tools/depth_network.py FOLDER WEIGHTS.npz [--steps 18000] [--onnx FILE]

The loss is that of a Laplace distribution of log depth with its sigma; the mean relative error,
which is greatest for distances that are estimated too far; and the cross entropy of "no return".
Every frame is used with some of its spots, as it is or mirrored, with the fog fit or without. One
family and every 20th scene are held out; on both, sigma is calibrated so that 95 % of the pixels
lie within 1.96 of it. Beside the weights, a JSON file of their name lists what they were trained
on, and their figures on the held-out frames.
"""

import argparse
import hashlib
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from threadpoolctl import threadpool_limits
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits, pixel_shuffle, pixel_unshuffle
from torch.utils.data import DataLoader, IterableDataset

from depth_frames import FAMILY_ASIDE, PLAN, from_arrays
from reconstruction.depth.network import (
    DEEP_BLOCKS,
    LOG_SIGMA,
    MIDDLE_BLOCKS,
    VERSION,
    features,
)
from reconstruction.depth.network_input import (
    MAPS,
    NUMBERS,
    Anchors,
    Inputs,
    NetworkInput,
    inputs_of,
)
from spisim.scene import families

SEED = 7
BATCH = 8
RATE = 1.2e-3
NARROW, MIDDLE, WIDE = 24, 48, 80
"""Channels at a half, a quarter and an eighth of the resolution."""
ASIDE = 20
AVERAGED = 0.998
WARM = 0.05
"""Share of the steps in which the rate rises."""
OF_RELATIVE, OF_NO_RETURN = 2.0, 1.0
"""Weights in the loss, besides that of the likelihood."""
BIASES = 0.0, -1.5, -2.0, -1.0
"""Of log depth over the start, log of its sigma, logits of nothing and of plain ranges."""
FARTHEST = 1.5
"""Error of log depth, at most: one pixel does not decide."""
USUAL = 0.05, 99.95
"""Percentiles of what is like the frames learned from."""
BEYOND = 0.1
"""What is still like them, over the range of a feature."""


class Blocks(nn.ModuleList):
    """Pairs of convolutions, each of which adds to what it is given."""

    def __init__(self, channels: int, blocks: int) -> None:
        super().__init__(nn.Conv2d(channels, channels, 3, padding=1) for _ in range(2 * blocks))

    def forward(self, channels: Tensor) -> Tensor:
        """Changed, block by block."""
        layers = list(self)
        for first, second in zip(layers[::2], layers[1::2], strict=True):
            channels = channels + second(torch.relu(first(channels)))
        return channels


class Net(nn.Module):
    """As `reconstruction.depth.network` evaluates it; ``biases`` are the first outputs."""

    def __init__(
        self, maps: int = MAPS, numbers: int = len(NUMBERS), biases: Sequence[float] = BIASES
    ) -> None:
        super().__init__()
        self.enter = nn.Conv2d(4 * maps + numbers, NARROW, 3, padding=1)
        self.before = nn.Conv2d(NARROW, NARROW, 3, padding=1)
        self.down = nn.Conv2d(4 * NARROW, MIDDLE, 1)
        self.middle = Blocks(MIDDLE, MIDDLE_BLOCKS)
        self.deeper = nn.Conv2d(4 * MIDDLE, WIDE, 1)
        self.deep = Blocks(WIDE, DEEP_BLOCKS)
        self.rise = nn.Conv2d(WIDE, 4 * MIDDLE, 1)
        self.again = Blocks(MIDDLE, MIDDLE_BLOCKS)
        self.up = nn.Conv2d(MIDDLE, 4 * NARROW, 1)
        self.after = nn.Conv2d(NARROW, NARROW, 3, padding=1)
        self.leave = nn.Conv2d(NARROW, 4 * len(biases), 3, padding=1)
        nn.init.zeros_(self.leave.weight)
        self.leave.bias = nn.Parameter(torch.tensor(biases).repeat_interleave(4))

    def forward(self, maps: Tensor, numbers: Tensor) -> Tensor:
        """Outputs (B, D, H, W) for maps (B, C, H, W) and numbers (B, N)."""
        half = pixel_unshuffle(maps, 2)
        constant = numbers[:, :, None, None].expand(-1, -1, *half.shape[2:])
        retained = torch.relu(self.enter(torch.cat([half, constant], dim=1)))
        retained = torch.relu(self.before(retained))
        quarter = self.middle(torch.relu(self.down(pixel_unshuffle(retained, 2))))
        eighth = self.deep(torch.relu(self.deeper(pixel_unshuffle(quarter, 2))))
        quarter = self.again(torch.relu(quarter + pixel_shuffle(self.rise(eighth), 2)))
        retained = torch.relu(retained + pixel_shuffle(self.up(quarter), 2))
        return pixel_shuffle(self.leave(torch.relu(self.after(retained))), 2)


class Frames:
    """Frames of files, as the network may see them."""

    def __init__(self, files: list[Path]) -> None:
        self.displayed: list[NetworkInput] = []
        self.depth_m: list[Any] = []
        self.family: list[str] = []
        for file in files:
            with np.load(file) as archive:
                columns = {name: archive[name] for name in archive.files}
            for number, family in enumerate(columns["family"].tolist()):
                each = {name: values[number] for name, values in columns.items()}
                if not np.percentile(each["image"], 90) > 0:  # dark: no method is asked
                    continue
                self.displayed.append(from_arrays(each))
                self.depth_m.append(each["depth_m"])
                self.family.append(family)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.displayed)

    def of(self, family: str) -> "tuple[Frames, Frames]":
        """Those of other families, and those of one."""
        others, its = Frames([]), Frames([])
        for displayed, depth_m, each in zip(self.displayed, self.depth_m, self.family, strict=True):
            part = its if each == family else others
            part.displayed.append(displayed)
            part.depth_m.append(depth_m)
            part.family.append(each)
        return others, its

    def batch(self, rng: np.random.Generator) -> list[Tensor]:
        """Some of them, varied: maps, numbers, starts and log depth."""
        chosen = rng.integers(len(self), size=BATCH)
        return stacked([varied(self.displayed[n], self.depth_m[n], rng) for n in chosen])


class Batches(IterableDataset[list[Tensor]]):
    """Batches of frames, without end."""

    def __init__(self, frames: Frames) -> None:
        super().__init__()
        self._frames = frames

    def __iter__(self) -> Iterator[list[Tensor]]:
        """The same ones every time."""
        threadpool_limits(1)
        rng = np.random.default_rng(SEED)
        while True:
            yield self._frames.batch(rng)


def varied(displayed: NetworkInput, depth_m: Any, rng: np.random.Generator) -> tuple[Inputs, Any]:
    """A frame as it might have been seen as well."""
    if rng.random() < 0.5:
        mirrored = displayed.directions * np.array([-1.0, 1.0, 1.0])
        displayed = replace(displayed, image=displayed.image[:, ::-1], directions=mirrored)
        depth_m = depth_m[:, ::-1]
    if rng.random() < 0.35:
        displayed = without_fog(displayed)
    if rng.random() < 0.3:
        displayed = without_spots(displayed, rng.random(4) < rng.uniform(0.2, 0.8))
    if rng.random() < 0.25:
        displayed = replace(displayed, log_reflectance=np.full(4, np.nan))
    jitter = rng.normal(0, 0.15)
    displayed = replace(displayed, log_reflectance=displayed.log_reflectance + jitter)
    return inputs_of(displayed), depth_m


def without_fog(displayed: NetworkInput) -> NetworkInput:
    """With plain ranges alone."""
    no_return = Anchors(np.full(4, np.nan), np.full(4, np.nan))
    return replace(
        displayed, fitted=no_return, extinction_per_m=np.nan, backscatter_per_m_sr=np.nan
    )


def without_spots(displayed: NetworkInput, dropped: Any) -> NetworkInput:
    """With some of the ranges unknown."""
    plain, fitted = (
        Anchors(*(np.where(dropped, np.nan, values) for values in anchors))
        for anchors in (displayed.plain, displayed.fitted)
    )
    return replace(displayed, plain=plain, fitted=fitted)


def stacked(frames: list[tuple[Inputs, Any]]) -> list[Tensor]:
    """Maps, numbers, starts and log depth, nan for nothing, of frames of one shape."""
    with np.errstate(divide="ignore"):
        columns = [
            [inputs.maps for inputs, _ in frames],
            [inputs.numbers for inputs, _ in frames],
            [[inputs.start, inputs.plain] for inputs, _ in frames],
            [np.log(depth_m) for _, depth_m in frames],
        ]
    return [torch.from_numpy(np.array(column, np.float32)) for column in columns]


def log_depth_of(out: Tensor, start: Tensor) -> Tensor:
    """Estimated log depth (B, H, W), of the two starts (B, 2, H, W)."""
    return start[:, 0] + torch.sigmoid(out[:, 3]) * (start[:, 1] - start[:, 0]) + out[:, 0]


def loss_of(out: Tensor, start: Tensor, log_depth: Tensor) -> tuple[Tensor, dict[str, Tensor]]:
    """The loss, and the parts of it."""
    there = torch.isfinite(log_depth)
    error = torch.where(there, log_depth_of(out, start) - torch.nan_to_num(log_depth), 0)
    error = error.clamp(-FARTHEST, FARTHEST)
    log_scale = out[:, 1].clamp(*LOG_SIGMA) - np.log(2) / 2  # of a Laplace distribution
    unlikely = log_scale + error.abs() * torch.exp(-log_scale)
    relative = (torch.exp(error) - 1).abs()
    fraction = there.float().mean(dim=(1, 2)).clamp(min=0.05)
    parts = {
        "unlikely": ((unlikely * there).mean(dim=(1, 2)) / fraction).mean(),
        "relative": ((relative * there).mean(dim=(1, 2)) / fraction).mean(),
        "nothing": binary_cross_entropy_with_logits(out[:, 2], (~there).float()),
    }
    loss = parts["unlikely"] + OF_RELATIVE * parts["relative"] + OF_NO_RETURN * parts["nothing"]
    return loss, parts


def trained(
    net: Net,
    batches: Iterator[list[Tensor]],
    loss_of_batch: Callable[[Net, list[Tensor]], tuple[Tensor, dict[str, Tensor]]],
    check: Callable[[nn.Module], Any],
    steps: int,
    minutes: float,
    peak_rate: float = RATE,
) -> tuple[Net, int]:
    """The mean of the weights over the last steps, and how many there were."""
    net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    mean = torch.optim.swa_utils.AveragedModel(
        net, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(AVERAGED)
    )
    optimiser = torch.optim.AdamW(net.parameters(), lr=peak_rate, weight_decay=1e-3)
    begun, step, done = time.perf_counter(), 0, 0.0
    recent: Counter[str] = Counter()
    while done < 1:
        optimiser.param_groups[0]["lr"] = peak_rate * rate(done)
        loss, parts = loss_of_batch(net, next(batches))
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        mean.update_parameters(net)
        recent.update({name: value.item() / 500 for name, value in parts.items()})
        step += 1
        seconds = time.perf_counter() - begun
        done = max(step / steps, seconds / (60 * minutes))
        if step % 500 == 0:
            retained = {name: round(value, 4) for name, value in recent.items()}
            print(f"{step} steps, {seconds:.0f} s, {100 * done:.0f} %: {retained}", flush=True)
            recent.clear()
            if step % 2000 == 0:
                print("  aside", check(mean.module), flush=True)
    retained_net = mean.module
    assert isinstance(retained_net, Net)
    return retained_net, step


def evaluated(net: Net, maps: Tensor, numbers: Tensor) -> Tensor:
    """Output in 32 bits, evaluated in 16 where processors can; elsewhere 16 are 5 times slower."""
    with torch.autocast("cpu", torch.bfloat16, enabled=torch.cpu._is_avx512_bf16_supported()):
        out: Tensor = net(maps.contiguous(memory_format=torch.channels_last), numbers)
    return out.float()


def loss_of_batch(net: Net, batch: list[Tensor]) -> tuple[Tensor, dict[str, Tensor]]:
    """The loss of a batch, and the parts of it."""
    maps, numbers, start, log_depth = batch
    return loss_of(evaluated(net, maps, numbers), start, log_depth)


def started(start: Path | None, net: Net) -> Net:
    """A network, with the weights of a file if there is one."""
    if start is not None:
        archive = np.load(start)
        net.load_state_dict({n: torch.from_numpy(archive[n]).float() for n in net.state_dict()})
    return net


def loaded(batches: IterableDataset[list[Tensor]]) -> Iterator[list[Tensor]]:
    """Batches made by a process of their own."""
    return iter(DataLoader(batches, batch_size=None, num_workers=1, prefetch_factor=8))


def rate(done: float) -> float:
    """Of learning, over the largest: it rises at once and falls as a cosine."""
    if done < WARM:
        return (done + 1e-3) / WARM
    return float(1 + np.cos(np.pi * (done - WARM) / (1 - WARM))) / 2


@torch.no_grad()
def reported(net: nn.Module, frames: Frames) -> tuple[Any, Any, Any, Any]:
    """Error of log depth, its sigma, probability of no return and its truth, (n, H, W)."""
    columns: list[list[Any]] = [[], [], [], []]
    for first in range(0, len(frames), BATCH):
        some = range(first, min(first + BATCH, len(frames)))
        pairs = [(inputs_of(frames.displayed[n]), frames.depth_m[n]) for n in some]
        maps, numbers, start, log_depth = stacked(pairs)
        out = net(maps, numbers)
        values = (
            log_depth_of(out, start) - log_depth,
            torch.exp(out[:, 1].clamp(*LOG_SIGMA)),
            torch.sigmoid(out[:, 2]),
            ~torch.isfinite(log_depth),
        )
        for column, value in zip(columns, values, strict=True):
            column.append(value.numpy())
    error, sigma, no_return, empty = (np.concatenate(column) for column in columns)
    return error, sigma, no_return, empty


def quality(net: nn.Module, frames: Frames, scale: float = 1.0) -> dict[str, float]:
    """AbsRel, fraction within 25 % and within 1.96 sigma, Brier score and that of base rates."""
    error, sigma, no_return, empty = reported(net, frames)
    relative = np.abs(np.expm1(error))[~empty]
    within = np.abs(error)[~empty] < 1.96 * scale * sigma[~empty]
    return {
        "abs_rel": float(np.mean(relative)),
        "within_25_percent": float(np.mean(np.abs(error[~empty]) < np.log(1.25))),
        "within_95_percent_interval": float(np.mean(within)),
        "brier": float(np.mean((no_return - empty) ** 2)),
        "brier_base": float(empty.mean() * (1 - empty.mean())),
        "sky_without_depth": float(np.mean(no_return[empty] > 0.5))
        if empty.any()
        else float("nan"),
    }


def calibration(net: nn.Module, held: Sequence[Frames]) -> float:
    """Log of the factor with which 95 % of the pixels lie within 1.96 deviations.

    The mean of those of unseen scenes and of an unseen family.
    """
    factors = []
    for frames in held:
        error, sigma, _, empty = reported(net, frames)
        factors.append(np.quantile(np.abs(error[~empty]) / sigma[~empty], 0.95) / 1.96)
    return float(np.mean(np.log(factors)))


def limits_of(frames: Frames) -> Any:
    """Of what makes a frame like these (2, features): as they are, or with less known of them."""
    rng = np.random.default_rng(SEED)
    result = []
    for number, displayed in enumerate(frames.displayed):
        poorer = without_fog(without_spots(displayed, rng.random(4) < 0.5))
        each = poorer if number % 2 else displayed
        result.append(features(each, inputs_of(each)))
    minimum, maximum = np.percentile(result, USUAL, axis=0)
    beyond = BEYOND * (maximum - minimum) + 1e-3
    return np.array([minimum - beyond, maximum + beyond], np.float32)


def digest(files: list[Path]) -> str:
    """SHA-256 over names and contents."""
    total = hashlib.sha256()
    for file in files:
        total.update(file.name.encode() + hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()


def main() -> None:
    """Train, and write weights and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--steps", type=int, default=18000)
    parser.add_argument("--minutes", type=float, default=np.inf, help="if that is sooner")
    parser.add_argument("--start", type=Path, help="weights to begin with")
    parser.add_argument("--rate", type=float, default=RATE, help="largest, of learning")
    parser.add_argument("--onnx", type=Path, help="file for the network as an ONNX graph")
    asked = parser.parse_args()
    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    files = sorted(asked.folder.glob("*.npz"))
    train, held = split(files)
    print(len(train), {name: len(each) for name, each in held.items()}, Counter(train.family))
    net, steps = trained(
        started(asked.start, Net()),
        loaded(Batches(train)),
        loss_of_batch,
        lambda net: quality(net, held["family"]),
        asked.steps,
        asked.minutes,
        asked.rate,
    )
    start = asked.start and hashlib.sha256(asked.start.read_bytes()).hexdigest()
    reported_of = {
        "steps": steps,
        "start": start,
        "data": digest(files),
        "scenes": scenes_of(files),
    }
    write(asked.weights, net, train, held, reported_of)
    if asked.onnx is not None:
        export(net, asked.onnx)


def split(files: list[Path]) -> tuple[Frames, dict[str, Frames]]:
    """Frames to learn from, and those kept aside: scenes of the same families, and one family."""
    aside = files[::ASIDE]
    train, family = Frames([file for file in files if file not in set(aside)]).of(FAMILY_ASIDE)
    return train, {"seeds": Frames(aside).of(FAMILY_ASIDE)[0], "family": family}


def scenes_of(files: list[Path]) -> str:
    """Numbers of the scenes in the plan."""
    return " ".join(str(int(file.stem)) for file in files)


def write(
    file: Path, net: Net, train: Frames, held: dict[str, Frames], manifest: dict[str, Any]
) -> None:
    """Weights, calibrated, with the limits of what they are for; and their figures."""
    log_scale = calibration(net, list(held.values()))
    weights = {name: value.half().numpy() for name, value in net.state_dict().items()}
    np.savez(
        file,
        version=VERSION,
        limits=limits_of(train),
        calibration=np.array([log_scale], np.float32),
        **weights,
    )
    manifest |= {
        "frames": len(train),
        "families": dict(Counter(train.family)),
        "family_aside": FAMILY_ASIDE,
        "seed": SEED,
        "plan": hashlib.sha256(PLAN.read_bytes()).hexdigest(),
        "drawn_by": digest(sorted(Path(families.__file__).parent.rglob("*.py"))),
        "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
        "aside": {name: quality(net, each, np.exp(log_scale)) for name, each in held.items()},
    }
    file.with_suffix(".json").write_text(json.dumps(manifest, indent=2) + "\n")


def export(net: Net, file: Path) -> None:
    """The network as an ONNX graph of maps (B, C, H, W) and numbers (B, N)."""
    maps, numbers = torch.zeros(1, MAPS, 64, 64), torch.zeros(1, len(NUMBERS))
    torch.onnx.export(
        net,
        (maps, numbers),
        str(file),
        input_names=["maps", "numbers"],
        output_names=["told"],
        dynamic_axes={"maps": {0: "frames", 2: "rows", 3: "columns"}, "numbers": {0: "frames"}},
        dynamo=False,
    )


if __name__ == "__main__":
    main()
