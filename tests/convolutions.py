"""What layers of networks are by definition, in double precision; shared by the tests."""

import numpy as np
from scipy.signal import correlate


def convolved(channels, weights, layer):
    """As a definition has it: the correlation with each kernel, zeros around."""
    kernels = weights[f"{layer}.weight"].astype(np.float64)
    biases = weights[f"{layer}.bias"].astype(np.float64)
    return np.array(
        [
            bias + sum(correlate(c, k, "same") for c, k in zip(channels, kernel, strict=True))
            for kernel, bias in zip(kernels, biases, strict=True)
        ]
    )


def unshuffled(channels):
    return np.array([c[i::2, j::2] for c in channels for i in range(2) for j in range(2)])


def shuffled(channels):
    out = np.empty((len(channels) // 4, 2 * channels.shape[1], 2 * channels.shape[2]))
    for number, channel in enumerate(channels):
        out[number // 4, number % 4 // 2 :: 2, number % 2 :: 2] = channel
    return out
