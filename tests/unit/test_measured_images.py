"""The comparison with recordings of a single-photon camera, on recordings that are drawn."""

import measured_images
import numpy as np
import pytest

from images import natural_image
from reconstruction.base.errors import InputError
from reconstruction.operators import expose, make_plan, with_throughput

PLAN = make_plan((16, 16), order="natural")


def written(folder, name, photons, *, spread, excess, seed):
    image = natural_image(16, 3) + 0.02
    light = expose(with_throughput(PLAN, spread=spread, seed=5), photons * image / image.sum())
    noise = np.sqrt(excess * light) * np.random.default_rng(seed).standard_normal(light.shape)
    np.save(folder / name, np.maximum(np.rint(light + noise), 0))


def test_noise_and_gain_of_drawn_recordings(tmp_path):
    for name, photons, seed in (
        ("240321_13_256_20000_0.npy", 1e5, 1),
        ("240321_13_256_80000_0.npy", 4e5, 2),
    ):
        written(tmp_path, name, photons, spread=0.3, excess=1.5, seed=seed)
    result = measured_images.compare(tmp_path, quick=True)
    noise, agreement, *gains = result.checks
    assert noise.value < 0.25
    assert agreement.value == noise.value
    assert len(gains) == 2
    assert min(gain.value for gain in gains) > 0.1
    factor = float(result.tables[0].rows[0][1].split()[0])
    assert factor == pytest.approx(1.5, abs=0.4)
    assert result.picture is not None


def test_recordings_without_scatter_promise_no_gain(tmp_path):
    written(tmp_path, "250101_1_256_20000_0.npy", 1e5, spread=0.0, excess=1.0, seed=1)
    result = measured_images.compare(tmp_path, quick=True)
    assert not result.checks
    assert "none beyond noise" in result.tables[1].rows[0]


def test_a_folder_without_recordings_is_refused(tmp_path):
    np.save(tmp_path / "other.npy", np.ones(3))
    with pytest.raises(InputError, match="holds no recording named"):
        measured_images.compare(tmp_path, quick=True)
