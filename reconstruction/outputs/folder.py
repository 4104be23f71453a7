"""Files of a reconstruction in a folder: pictures, point cloud, and the result itself."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

import numpy as np

from ..base.arrays import usual_float_errors
from ..base.files import Output, write_atomically
from ..capture import Setup
from ..depth import DEPTH_METHODS, MAX_RANGE_M, pixel_rays, point_cloud_ply
from ..evaluation.methods import method_title
from ..image import DICTIONARIES, IMAGE_METHODS
from ..result import Result
from .pictures import depth_picture, image_picture, no_return_picture, sigma_picture
from .result_file import result_bytes


class Recorded(Protocol):
    """A recording, or anything else with a setup."""

    @property
    def setup(self) -> Setup:
        """What its frames share."""


def outputs_in(directory: str | Path) -> list[Output]:
    """All files that a reconstruction may write into a folder, by any method."""
    folder = Path(directory)
    with_dictionary = [f"{name}:{atoms}" for name in IMAGE_METHODS for atoms in DICTIONARIES]
    pictures = {"image": [*IMAGE_METHODS, *with_dictionary]}
    pictures |= {kind: list(DEPTH_METHODS) for kind in ("depth", "depth deviation", "nothing")}
    return [
        Output(folder / "result.h5", "result"),
        Output(folder / "cloud.ply", "point cloud"),
        *(
            Output(folder / name, kind)
            for kind, methods in pictures.items()
            for name in _names(kind, methods)
        ),
    ]


@usual_float_errors
def write_outputs(result: Result, recording: Recorded, directory: str | Path) -> dict[str, Path]:
    """Write result.h5, cloud.ply, and a picture of each image and depth map.

    image.png and depth.png are of the default methods; others have the method in their names.
    Methods that estimate them add depth-deviation.png and nothing.png. Everything is made before
    the first file is written, each file appears whole or not at all, and pictures and clouds of an
    earlier result are removed. Other files of these names are replaced; check `outputs_in` with
    `require_outputs` before.

    Parameters
    ----------
    result : Result
        What to write.
    recording : Recorded
        Its capture, or anything with the same setup.
    directory : str or Path
        Folder, which is made if it is missing.

    Returns
    -------
    dict of str to Path
        Paths by file name.

    Raises
    ------
    InputError
        If the folder cannot be written into.
    OSError
        If a file cannot be written.
    """
    setup = recording.setup
    contents = _pictures(result, setup)
    contents["result.h5"] = result_bytes(result)
    if result.depth_m is not None and setup.optics is not None:
        points = pixel_rays(setup.optics, setup.plan.shape) * result.depth_m[..., None]
        contents["cloud.ply"] = point_cloud_ply(points, result.image.astype(np.float64))
    folder = Path(directory)
    for name, content in contents.items():
        write_atomically(folder / name, content)
    for output in outputs_in(folder):
        if output.path.name not in contents and output.path.is_file() and output.is_ours:
            output.path.unlink()
    return {name: folder / name for name in contents}


def _pictures(result: Result, setup: Setup) -> dict[str, bytes]:
    pictures = {}
    images = result.images if setup.plan.shows_image else {}
    for number, (name, image) in enumerate(images.items()):
        title = f"Image ({method_title('images', name)})"
        pictures[_file("image", name, number)] = image_picture(image, title, result.unit)
    for number, (name, depth_m) in enumerate(result.depths.items()):
        title = f"Depth ({method_title('depths', name)})"
        no_return, sigma = result.no_returns.get(name), result.log_depth_sigmas.get(name)
        pictures[_file("depth", name, number)] = depth_picture(
            depth_m, title, result.aimed(setup), result.ranges, no_return
        )
        if sigma is not None:
            title = f"Deviation ({method_title('depths', name)})"
            pictures[_file("depth deviation", name, number)] = sigma_picture(sigma, title)
        if no_return is not None:
            title = f"Nothing within {MAX_RANGE_M:g} m ({method_title('depths', name)})"
            pictures[_file("nothing", name, number)] = no_return_picture(no_return, title)
    return pictures


def _names(kind: str, methods: Iterable[str]) -> list[str]:
    return list(dict.fromkeys([_file(kind, "", 0), *(_file(kind, name, 1) for name in methods)]))


def _file(kind: str, method: str, number: int) -> str:
    """Name of the picture of the ``number``-th method."""
    stem = kind.replace(" ", "-")
    return f"{stem}.png" if number == 0 else f"{stem}_{re.sub('[^A-Za-z0-9]', '_', method)}.png"
