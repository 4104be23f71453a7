"""OpenEXR files, read again."""

import OpenEXR


def read_exr(path):
    """Channels, each (H, W), and the text attributes of an OpenEXR file."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        return channels, {k: v for k, v in file.header().items() if isinstance(v, str)}
