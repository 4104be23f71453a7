"""Patterns that are trained through the instrument, and how they are judged."""

import json

import inverse_patterns
import numpy as np
import pytest
from inverse_patterns import Case, Scenes

from spisim.scene.families import FAMILIES

SIDE, PATTERNS = 16, 12


def test_shipped_patterns_are_black_and_white_and_name_what_they_were_trained_on():
    patterns = inverse_patterns.unpacked(inverse_patterns.TRAINED)
    assert patterns.shape == (127, 64, 64)
    assert (patterns[0] == 1).all()
    assert 0.3 < patterns[1:].mean() < 0.7
    manifest = json.loads(inverse_patterns.TRAINED.with_suffix(".json").read_text())
    assert set(manifest["families"]) < set(FAMILIES)
    assert manifest["patterns"] == len(patterns)


def test_means_are_of_families_and_intervals_of_scenes():
    cases = [
        Case(family, seed, np.zeros((2, 2)), 0.0)
        for family, seeds in (("a", (1, 1, 2)), ("b", (1,)))
        for seed in seeds
    ]
    scenes = Scenes(cases)
    values = np.array([1.0, 1.0, 4.0, 6.0])
    assert scenes.of("a", values) == 2.0
    assert scenes.mean(values) == 4.0
    assert scenes.count("a") == 3
    low, high = scenes.interval(values)(0.95)
    assert 1.0 <= low < 4.0 < high <= 6.0
    assert scenes.with_interval(0 * values) == "–"


class TestTraining:
    """Where PyTorch is installed."""

    @pytest.fixture
    def train(self):
        pytest.importorskip("torch")
        import train_patterns

        return train_patterns

    def images(self, torch, count):
        """Blobs as bright as scenes."""
        rng = np.random.default_rng(1)
        at = np.arange(SIDE)
        centres, width = rng.uniform(0, SIDE, (2, count, 1)), SIDE / 5
        down, along = np.exp(-(((at - centres) / width) ** 2))
        return torch.tensor(1e-8 * (0.3 + down[:, :, None] * along[:, None]), dtype=torch.float32)

    def model(self):
        from spisim_inverse.layers import ReadingModel

        return ReadingModel(np.full((SIDE, SIDE), 5e11), background=5e5, noise_electrons=7e3)

    def test_training_makes_black_and_white_patterns_that_estimate_better(self, train):
        import torch

        torch.manual_seed(0)
        model, images = self.model(), self.images(torch, 64)
        patterns = train.trained(model, [images], PATTERNS, steps=40, batch=16)
        assert patterns.shape == (PATTERNS, SIDE, SIDE)
        assert np.isin(patterns, (0, 1)).all()
        assert (patterns[0] == 1).all()
        decoder = train.Decoder((SIDE, SIDE), images)

        def loss(binary):
            torch.manual_seed(5)
            binary = torch.tensor(binary, dtype=torch.float32)
            error = (decoder(model, binary, images) - images).square().mean(dim=(1, 2))
            return float(torch.log(error).mean())

        plan = train.make_plan((SIDE, SIDE), PATTERNS, "variance-ranked", "signed")
        ranked = plan.patterns.matrix(plan.index).reshape(-1, SIDE, SIDE) > 0
        assert loss(patterns) < loss(ranked)

    def test_moved_images_have_the_values_of_the_images(self, train):
        import torch

        images = self.images(torch, 3)
        moved = train.moved(images)
        assert moved.shape == images.shape
        for image, other in zip(images, moved, strict=True):
            assert np.isin(other.numpy(), image.numpy()).all()
