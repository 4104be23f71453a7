"""Images and true depth images of all samples with a COCO index (cocodataset.org).

Every image has one annotation of the category "spots", of as many as it has. Its `keypoints` are
the pixel coordinates of the laser spots, where (0, 0) is the centre of the first pixel as in COCO.
It also holds their measured ranges.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reconstruction.base.files import mark
from reconstruction.base.text import json_line
from reconstruction.depth import pixel_of
from reconstruction.exports import Shot
from reconstruction.exports.export import KIND
from reconstruction.exports.pictures import colour_png, depth_png
from spisim_formats.samples._writing import true_shots, write_whole

if TYPE_CHECKING:
    from spisim.dataset.reader import DataSet
    from spisim.dataset.stored_sample import StoredSample

#: COCO's flag of a keypoint that is labelled and visible.
VISIBLE = 2


def write_coco(samples: DataSet, folder: Path, shard_size: int = 0) -> list[Path]:
    """Write `index.json`, and a PNG file per frame into `images` and `depth`.

    Raises InputError as `write_whole`, and for samples without truth. The shard size is ignored.
    """
    return write_whole(samples, folder, lambda stage: _write(samples, stage))


def _write(samples: DataSet, folder: Path) -> None:
    for name in ("images", "depth"):
        (folder / name).mkdir()
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    categories: dict[int, int] = {}  # by number of spots
    for sample in samples:
        for frame, shot in enumerate(true_shots(sample)):
            name = f"{sample.index:06d}" + (f"-{frame:04d}" if frame else "") + ".png"
            (folder / "images" / name).write_bytes(colour_png(shot.image))
            (folder / "depth" / name).write_bytes(depth_png(shot.depth_m, shot.shape))
            images.append(_image(len(images) + 1, name, shot, sample))
            if shot.spots is not None and shot.ranges is not None:
                truth = sample.capture.truth
                assert truth is not None
                true_m = truth.at(frame).spot_range_m
                kind = categories.setdefault(len(true_m), len(categories) + 1)
                annotations.append(_spots(len(annotations) + 1, len(images), kind, shot, true_m))
    index = {
        "info": {
            "description": samples.meta.get("name", ""),
            "made": mark(KIND),
            "depth": "along the optical axis, 16 bits, millimetres; 0: none",
        },
        "licenses": [],
        "categories": [_category(number, spots) for spots, number in categories.items()],
        "images": images,
        "annotations": annotations,
    }
    (folder / "index.json").write_text(json_line(index) + "\n", encoding="ascii")


def _category(number: int, spots: int) -> dict[str, Any]:
    return {
        "id": number,
        "name": "spots",
        "supercategory": "laser",
        "keypoints": [f"spot {k}" for k in range(spots)],
        "skeleton": [],
    }


def _image(number: int, name: str, shot: Shot, sample: StoredSample) -> dict[str, Any]:
    height, width = shot.shape
    return {
        "id": number,
        "file_name": f"images/{name}",
        "depth_file_name": f"depth/{name}",
        "width": width,
        "height": height,
        "intrinsics": shot.intrinsics._asdict(),
        "world_from_optical": None if shot.pose is None else shot.pose.tolist(),
        "sample": sample.index,
        "scene_name": sample.scene_name,
        "parameters": dict(sample.parameters),
    }


def _spots(number: int, image: int, kind: int, shot: Shot, true_m: np.ndarray) -> dict[str, Any]:
    """Return the annotation of an image; the box encloses the visible spots, in pixels."""
    assert shot.spots is not None
    assert shot.ranges is not None
    height, width = shot.shape
    positions = pixel_of(shot.spots.directions, shot.complete_optics, shot.shape)[:, ::-1]
    within = (positions > -0.5) & (positions < (width - 0.5, height - 0.5))
    inside = np.flatnonzero(within.all(axis=1))
    points = np.zeros((len(positions), 3))
    points[inside] = np.column_stack([positions[inside], np.full(len(inside), VISIBLE)])
    visible = positions[inside] if inside.size else np.zeros((1, 2))
    size = np.ptp(visible, axis=0)
    return {
        "id": number,
        "image_id": image,
        "category_id": kind,
        "iscrowd": 0,
        "keypoints": points.ravel().tolist(),
        "num_keypoints": len(inside),
        "bbox": [*visible.min(axis=0).tolist(), *size.tolist()],
        "area": float(size.prod()),
        "range_m": _numbers(shot.ranges.range_m),
        "sigma_m": _numbers(shot.ranges.sigma_m),
        "status": list(shot.ranges.status),
        "true_range_m": _numbers(true_m),
    }


def _numbers(values: np.ndarray) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


EXPORT = write_coco
